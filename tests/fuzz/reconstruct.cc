// A database with changed rows, through all stages to the files of the result.
#include "cairn/mapper/reconstruct.h"

#include "fuzz/mutated_database.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {

void FuzzReconstruct(std::string_view input) {
  static MutatedDatabase mutated;
  static const Scratch output;
  const Database& database = mutated.Mutate(input);
  ReconstructSettings settings;
  settings.reconstruct.max_rounds = 1;
  ReadOrRefuse([&] {
    ReconstructResult result = Reconstruct(database, "", settings, {.num_threads = 1});
    WriteReconstructResult(result, output.path(), "");
  });
}

}  // namespace cairn::fuzz
