#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "cairn/base/options.h"

namespace cairn {

// Exit codes of every program (src/STYLE.md, "Errors").
enum ExitCode : int {
  kExitSuccess = 0,
  kExitNoUsableResult = 1,
  kExitUsage = 2,
  kExitIo = 3,
  kExitBug = 4,
};

// One field of an options struct, bound to its flag and its TOML key.
struct BoundOption;

// A program's only command, or one of its subcommands. It binds options structs to flags
// `--module.field` and to the TOML tables `[module]` of `--config FILE`; precedence: default, file,
// flag. Options with the module name "" are the top-level flags: `--image_path`, `--seed`.
class Command {
 public:
  Command(CLI::App& app, std::string name);
  ~Command();

  // Binds the fields that options.VisitFields lists. `options` must outlive the program's Run.
  template <class Options>
  void AddOptions(const std::string& module, Options& options) {
    AddFields(module, FieldsOf(options));
    validators_.push_back([module, &options] { ValidateOptions(options, module); });
    dumpers_.push_back({module, [&options] { return DumpOptions(options); }});
  }
  // What the command does, after all options are read and valid; the result is the exit code.
  void SetRun(std::function<int()> run);

  // Was the option `key` ("seed", "matching.max_ratio") given, by file or flag?
  bool IsSet(const std::string& key) const { return is_set_.contains(key); }
  // Gives options that were not given, by file or flag, the values of TOML text. Names that the
  // command lacks are passed over. Throws IoError(origin, ...) where the text is no TOML.
  void SetDefaults(const std::string& text, const std::string& origin);
  // Throws ConfigError unless the option was given and is not empty.
  void Require(const std::string& key) const;
  // The options in force as TOML, with the program's name and version as comments, without these.
  std::string EffectiveToml(const std::vector<std::string>& left_out = {}) const;

 private:
  void AddFields(const std::string& module, const std::vector<OptionField>& fields);
  // Of an earlier run: names that are not there and values that are none are passed over.
  void ApplyToml(const std::string& text, const std::string& origin, bool of_earlier_run);
  void Apply();

  CLI::App& app_;
  std::string name_;
  std::string config_path_;
  std::vector<std::unique_ptr<BoundOption>> fields_;
  std::vector<std::function<void()>> validators_;
  struct Dumper {
    std::string module;
    std::function<std::string()> dump;
  };
  std::vector<Dumper> dumpers_;
  std::set<std::string> is_set_;
  std::function<int()> run_;
  friend class Program;
  int exit_code_ = kExitSuccess;
};

// What main returns: body's exit code, or that of the exception that it throws, with one clear line
// on the error stream. Memory or threads that are not to be had are an error of the environment
// (kExitIo) wherever they are missed: in any thread, in libraries that end the program themselves,
// and before main, where OpenBLAS makes its threads.
int RunMain(const std::function<int()>& body);

// A command-line program: parses, and runs one command. For use within RunMain.
class Program {
 public:
  Program(std::string name, const std::string& description);
  ~Program();

  // For a program without subcommands.
  Command& MainCommand();
  // For a program with subcommands.
  Command& AddCommand(const std::string& name, const std::string& description);

  int Run(int argc, char** argv);

 private:
  std::string name_;
  CLI::App app_;
  std::vector<std::unique_ptr<Command>> commands_;
};

}  // namespace cairn
