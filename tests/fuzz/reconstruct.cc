// A database with changed rows, through all stages to the files of the result.
#include "cairn/mapper/reconstruct.h"

#include "fuzz/mutated_database.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {

void FuzzReconstruct(std::string_view input) {
  static const MutatedDatabase mutated;
  static const Scratch output;
  const std::string& path = mutated.Mutate(input);
  ReconstructSettings settings;
  settings.reconstruct.max_rounds = 1;
  ReadOrRefuse([&] {
    const Database database(path, Database::Mode::kSnapshot);
    ReconstructResult result = Reconstruct(database, "", settings, {.num_threads = 1});
    WriteReconstructResult(result, output.path(), "");
  });
}

}  // namespace cairn::fuzz
