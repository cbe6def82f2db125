#include "common/program.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <cstdio>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/unknown_option.h"

namespace cairn {

// How a field is set from text (a flag) or from a TOML value turned into text.
struct OptionField {
  std::string key;  // "module.field" or "field"
  std::function<void(const std::string& text)> set;
  std::vector<std::string> flag_text;  // values given on the command line
  bool has_flag = false;
};

namespace {

bool ParseBool(const std::string& key, const std::string& text) {
  if (text.empty() || text == "1" || text == "true") return true;
  if (text == "0" || text == "false") return false;
  throw ConfigError(key, "'" + text + "' is not a boolean (0, 1, true, false)");
}

template <class Number>
Number ParseNumber(const std::string& key, const std::string& text, const char* what) {
  Number value{};
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end) {
    throw ConfigError(key, "'" + text + "' is not " + what);
  }
  return value;
}

std::vector<double> ParseDoubles(const std::string& key, const std::string& text) {
  std::vector<double> values;
  size_t begin = 0;
  while (begin < text.size()) {
    const size_t end = std::min(text.find(',', begin), text.size());
    values.push_back(
        ParseNumber<double>(key, text.substr(begin, end - begin), "a list of numbers (a,b,c)"));
    begin = end + 1;
  }
  return values;
}

// Adds a CLI11 option and an OptionField for every field that it visits.
class Binder : public OptionVisitor {
 public:
  Binder(CLI::App& app, std::string module, std::vector<std::unique_ptr<OptionField>>& fields)
      : app_(app), module_(std::move(module)), fields_(fields) {}

  void Bool(std::string_view name, bool& value, std::string_view help) override {
    // CLI11 would take a default text as the value of a bare `--x`, so the default stands in the
    // type.
    Add(name, help, value ? "BOOLEAN=1" : "BOOLEAN=0", "",
        [&value](const std::string& key, const std::string& text) { value = ParseBool(key, text); })
        ->expected(0, 1);
  }
  void Int(std::string_view name, int& value, OptionRange range, std::string_view help) override {
    Add(name, help, "INT", std::to_string(value),
        [&value](const std::string& key, const std::string& text) {
          value = ParseNumber<int>(key, text, "an integer");
        });
  }
  void Double(std::string_view name, double& value, OptionRange range,
              std::string_view help) override {
    Add(name, help, "NUMBER", Shortest(value),
        [&value](const std::string& key, const std::string& text) {
          value = ParseNumber<double>(key, text, "a number");
        });
  }
  void String(std::string_view name, std::string& value, std::string_view help) override {
    Add(name, help, "TEXT", value,
        [&value](const std::string&, const std::string& text) { value = text; });
  }
  void Doubles(std::string_view name, std::vector<double>& value, std::string_view help) override {
    Add(name, help, "A,B,...", "", [&value](const std::string& key, const std::string& text) {
      value = ParseDoubles(key, text);
    });
  }

 private:
  void Choice(std::string_view name, const ChoiceField& field, std::string_view help) override {
    std::string allowed;
    for (const std::string& choice : field.names) allowed += (allowed.empty() ? "" : "|") + choice;
    Add(name, help, allowed, field.get(), [field](const std::string& key, const std::string& text) {
      CheckChoice(key, text, field.names);
      field.set(text);
    });
  }

  static std::string Shortest(double value) {
    char text[32];
    return std::string(text, std::to_chars(text, text + sizeof(text), value).ptr);
  }

  CLI::Option* Add(std::string_view name, std::string_view help, const std::string& type,
                   const std::string& default_text,
                   std::function<void(const std::string&, const std::string&)> set) {
    auto field = std::make_unique<OptionField>();
    field->key = module_.empty() ? std::string(name) : module_ + "." + std::string(name);
    field->set = [key = field->key, set = std::move(set)](const std::string& text) {
      set(key, text);
    };
    OptionField* const raw = field.get();
    CLI::Option* option = app_.add_option(
        "--" + field->key,
        [raw](const CLI::results_t& results) {
          raw->has_flag = true;
          raw->flag_text = results;
          return true;
        },
        std::string(help));
    option->type_name(type)
        ->default_str(default_text)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    if (!module_.empty()) option->group("Options of " + module_);
    fields_.push_back(std::move(field));
    return option;
  }

  CLI::App& app_;
  std::string module_;
  std::vector<std::unique_ptr<OptionField>>& fields_;
};

// A TOML value as the text that a flag would have.
std::string TomlText(const std::string& key, const toml::node& node) {
  if (const auto* v = node.as_boolean()) return v->get() ? "true" : "false";
  if (const auto* v = node.as_integer()) return std::to_string(v->get());
  if (const auto* v = node.as_floating_point()) {
    char text[32];
    return std::string(text, std::to_chars(text, text + sizeof(text), v->get()).ptr);
  }
  if (const auto* v = node.as_string()) return v->get();
  if (const auto* v = node.as_array()) {
    std::string text;
    for (const toml::node& item : *v) text += (text.empty() ? "" : ",") + TomlText(key, item);
    return text;
  }
  throw ConfigError(key, "this kind of TOML value is not understood");
}

// Calls visit("module.field", value) and visit("field", value) for all values of a file.
void ForEachKey(const toml::table& table,
                const std::function<void(const std::string&, const toml::node&)>& visit) {
  for (const auto& [name, node] : table) {
    const std::string key(name.str());
    if (const toml::table* module = node.as_table()) {
      for (const auto& [field, value] : *module) visit(key + "." + std::string(field.str()), value);
    } else {
      visit(key, node);
    }
  }
}

}  // namespace

Command::Command(CLI::App& app, std::string name) : app_(app), name_(std::move(name)) {
  app_.add_option("--config", config_path_, "TOML file with options; flags override it")
      ->type_name("FILE");
  app_.get_formatter()->column_width(46);
}

Command::~Command() = default;

std::unique_ptr<OptionVisitor> Command::MakeBinder(const std::string& module) {
  return std::make_unique<Binder>(app_, module, fields_);
}

void Command::SetRun(std::function<int()> run) {
  run_ = std::move(run);
  app_.callback([this] {
    Apply();
    exit_code_ = run_();
  });
}

void Command::Require(const std::string& key) const {
  for (const auto& field : fields_) {
    if (field->key == key && is_set_.count(key) > 0) return;
  }
  throw ConfigError("--" + key, "is required; see --help");
}

void Command::ReadConfigFile(const std::string& path) {
  toml::table table;
  try {
    table = toml::parse(ReadFile(path), path);
  } catch (const toml::parse_error& error) {
    throw ConfigError(path + ":" + std::to_string(error.source().begin.line),
                      std::string(error.description()));
  }
  std::vector<std::string> known;
  for (const auto& field : fields_) known.push_back(field->key);
  const auto set = [&](const std::string& key, const toml::node& node) {
    for (const auto& field : fields_) {
      if (field->key != key) continue;
      field->set(TomlText(key, node));
      is_set_.insert(key);
      return;
    }
    if (const std::string value = RetiredValue(key); !value.empty()) {
      if (value == "*" || TomlText(key, node) == value) return;
    }
    throw ConfigError(path, "unknown key " + DescribeUnknownOption(key, known));
  };
  ForEachKey(table, set);
}

void Command::SetDefaults(const std::string& text, const std::string& origin) {
  toml::table table;
  try {
    table = toml::parse(text);
  } catch (const toml::parse_error& error) {
    throw IoError(origin, "its options cannot be read: " + std::string(error.description()));
  }
  ForEachKey(table, [&](const std::string& key, const toml::node& value) {
    const auto field =
        std::find_if(fields_.begin(), fields_.end(), [&](const auto& f) { return f->key == key; });
    if (field == fields_.end() || IsSet(key)) return;
    try {
      (*field)->set(TomlText(key, value));
    } catch (const ConfigError&) {
      // What another version wrote is no value of today; the stage itself says so where it matters.
    }
  });
  for (const auto& validate : validators_) validate();
}

void Command::Apply() {
  if (!config_path_.empty()) ReadConfigFile(config_path_);
  for (const auto& field : fields_) {
    if (!field->has_flag) continue;
    field->set(field->flag_text.empty() ? "" : field->flag_text.back());
    is_set_.insert(field->key);
  }
  for (const auto& validate : validators_) validate();
}

std::string Command::EffectiveToml() const {
  std::string text = "# " + name_ + ", cairn " CAIRN_VERSION "\n";
  for (const Dumper& dumper : dumpers_) {
    if (!dumper.module.empty()) text += "\n[" + dumper.module + "]\n";
    text += dumper.dump();
  }
  return text;
}

Program::Program(std::string name, const std::string& description)
    : name_(std::move(name)), app_(description, name_) {
  auto logger = std::make_shared<spdlog::logger>(
      name_, std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  logger->set_pattern("%H:%M:%S %^%l%$ %v");
  spdlog::set_default_logger(std::move(logger));
  app_.set_version_flag("--version", name_ + ", cairn " CAIRN_VERSION);
}

Program::~Program() = default;

Command& Program::MainCommand() {
  commands_.push_back(std::make_unique<Command>(app_, name_));
  return *commands_.back();
}

Command& Program::AddCommand(const std::string& name, const std::string& description) {
  app_.require_subcommand(1);
  CLI::App* const sub = app_.add_subcommand(name, description);
  commands_.push_back(std::make_unique<Command>(*sub, name_ + " " + name));
  return *commands_.back();
}

namespace {

// CLI11 reports unknown flags as "extras"; add the nearest flag of the command that was meant.
std::string DescribeParseError(const CLI::App& app, const CLI::ParseError& error) {
  const std::vector<std::string> words = app.remaining();
  if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError) &&
      app.get_subcommands().empty() && !words.empty()) {
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands(nullptr))
      names.push_back(command->get_name());
    return "unknown command '" + words.front() + "'" + DidYouMean(words.front(), names);
  }
  if (error.get_exit_code() != static_cast<int>(CLI::ExitCodes::ExtrasError)) return error.what();
  const CLI::App* command = &app;
  if (!app.get_subcommands().empty()) command = app.get_subcommands().front();
  std::vector<std::string> known;
  for (const CLI::Option* option : command->get_options()) {
    known.push_back(option->get_name());
  }
  const std::vector<std::string> extras = app.remaining(true);
  if (extras.empty()) return error.what();
  const std::string flag = extras.front().substr(0, extras.front().find('='));
  return "unknown argument " + DescribeUnknownOption(flag, known);
}

int Fail(const std::string& message, int exit_code) {
  spdlog::error("{}", message);
  return exit_code;
}

}  // namespace

int Program::Run(int argc, char** argv) {
  try {
    app_.parse(argc, argv);
    for (const auto& command : commands_) {
      if (command->exit_code_ != kExitSuccess) return command->exit_code_;
    }
    return kExitSuccess;
  } catch (const CLI::Success& request) {  // --help, --version
    return app_.exit(request);
  } catch (const CLI::ParseError& error) {
    return Fail(DescribeParseError(app_, error), kExitUsage);
  }
}

}  // namespace cairn
