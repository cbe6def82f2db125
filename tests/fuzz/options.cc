// Command lines (a word a line), TOML files, and the options that a database or a folder keeps.
#include "common/program.h"
#include "common/run_flags.h"
#include "fuzz/input.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {
namespace {

enum class Letter { kA, kB };
constexpr NamedValue<Letter> kLetters[] = {{Letter::kA, "a"}, {Letter::kB, "b"}};

// An option of every kind.
struct AllKinds {
  bool flag = false;
  int count = 1;
  double ratio = 0.5;
  std::string name = "x";
  std::vector<double> numbers = {1, 2};
  Letter letter = Letter::kA;

  void VisitFields(OptionVisitor& v) {
    v.Bool("flag", flag, "");
    v.Int("count", count, {0, 1e9}, "");
    v.Double("ratio", ratio, {0, 1}, "");
    v.String("name", name, "");
    v.Doubles("numbers", numbers, "");
    v.Choice("letter", letter, kLetters, "");
  }
};

std::vector<std::string> Lines(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const size_t end = std::min(text.find('\n'), text.size());
    lines.emplace_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return lines;
}

}  // namespace

void FuzzOptions(std::string_view input) {
  static const Scratch scratch;
  const std::vector<std::string_view> files = SplitFiles(input, 3);
  std::vector<std::string> words = Lines(files[0]);
  words.insert(words.begin(), "program");
  if (!files[1].empty()) {
    words.insert(words.end(), {"--config", scratch.Write("options.toml", files[1])});
  }
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());

  Program program("program", "");
  Command& command = program.MainCommand();
  RunFlags flags;
  AllKinds options;
  command.AddOptions("", flags);
  command.AddOptions("module", options);
  command.SetRun([&] {
    command.SetDefaults(std::string(files[2]), "database");
    return command.EffectiveToml().empty() ? 1 : 0;
  });
  ReadOrRefuse([&] { program.Run(static_cast<int>(arguments.size()), arguments.data()); });
}

}  // namespace cairn::fuzz
