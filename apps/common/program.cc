#include "common/program.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <toml++/toml.h>

#include <algorithm>
#include <charconv>

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"

namespace cairn {

// How a field is set from text (a flag) or from a TOML value turned into text.
struct BoundOption {
  std::string key;  // "module.field" or "field"
  std::function<void(const std::string& text)> set;
  std::vector<std::string> flag_text;  // values given on the command line
  bool has_flag = false;
  bool is_list = false;
  bool is_empty = false;  // it was given as ""
};

namespace {

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
  for (size_t begin = 0; !text.empty() && begin <= text.size();) {
    const size_t end = std::min(text.find(',', begin), text.size());
    begin = std::min(text.find_first_not_of(' ', begin), end);  // after a comma
    values.push_back(
        ParseNumber<double>(key, text.substr(begin, end - begin), "a list of numbers (a,b,c)"));
    begin = end + 1;
  }
  return values;
}

std::string Shortest(double value) {
  char text[32];
  return std::string(text, std::to_chars(text, text + sizeof(text), value).ptr);
}

// The type and the default of a flag in --help.
struct FlagHelp {
  std::string type, default_text;
};

// CLI11 would take a default text as the value of a bare `--x`, so the default stands in the type.
FlagHelp HelpOf(const bool* value) { return {*value ? "BOOLEAN=1" : "BOOLEAN=0", ""}; }
FlagHelp HelpOf(const int* value) { return {"INT", std::to_string(*value)}; }
FlagHelp HelpOf(const double* value) { return {"NUMBER", Shortest(*value)}; }
FlagHelp HelpOf(const std::string* value) { return {"TEXT", *value}; }
FlagHelp HelpOf(const std::vector<double>*) { return {"A,B,...", ""}; }
FlagHelp HelpOf(const ChoiceField& field) {
  std::string allowed;
  for (const std::string& choice : field.names) allowed += (allowed.empty() ? "" : "|") + choice;
  return {allowed, field.get()};
}

void Set(const std::string& key, bool* value, const std::string& text) {
  const bool is_true = text.empty() || text == "1" || text == "true";
  if (!is_true && text != "0" && text != "false") {
    throw ConfigError(key, "'" + text + "' is not a boolean (0, 1, true, false)");
  }
  *value = is_true;
}
void Set(const std::string& key, int* value, const std::string& text) {
  *value = ParseNumber<int>(key, text, "an integer");
}
void Set(const std::string& key, double* value, const std::string& text) {
  *value = ParseNumber<double>(key, text, "a number");
}
void Set(const std::string&, std::string* value, const std::string& text) { *value = text; }
void Set(const std::string& key, std::vector<double>* value, const std::string& text) {
  *value = ParseDoubles(key, text);
}
void Set(const std::string& key, const ChoiceField& field, const std::string& text) {
  CheckChoice(key, text, field.names);
  field.set(text);
}

// A TOML value as the text that a flag would have.
std::string TomlText(const std::string& key, const toml::node& node) {
  if (const auto* v = node.as_boolean()) return v->get() ? "true" : "false";
  if (const auto* v = node.as_integer()) return std::to_string(v->get());
  if (const auto* v = node.as_floating_point()) return Shortest(v->get());
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

void Command::AddFields(const std::string& module, const std::vector<OptionField>& fields) {
  for (const OptionField& field : fields) {
    fields_.push_back(std::make_unique<BoundOption>());
    BoundOption* const bound = fields_.back().get();
    bound->key = OptionKey(module, field.name);
    bound->set = [bound, value = field.value](const std::string& text) {
      std::visit([&](const auto& v) { Set(bound->key, v, text); }, value);
      bound->is_empty = text.empty();
    };
    CLI::Option* const option = app_.add_option(
        "--" + bound->key,
        [bound](const CLI::results_t& results) {
          bound->has_flag = true;
          bound->flag_text = results;
          return true;
        },
        field.help);
    const FlagHelp help = std::visit([](const auto& v) { return HelpOf(v); }, field.value);
    option->type_name(help.type)
        ->default_str(help.default_text)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
    if (std::holds_alternative<bool*>(field.value)) option->expected(0, 1);
    bound->is_list = std::holds_alternative<std::vector<double>*>(field.value);
    if (!module.empty()) option->group("Options of " + module);
  }
}

void Command::SetRun(std::function<int()> run) {
  run_ = std::move(run);
  app_.callback([this] {
    Apply();
    exit_code_ = run_();
  });
}

void Command::Require(const std::string& key) const {
  const auto field = std::ranges::find(fields_, key, [](const auto& f) { return f->key; });
  if (field == fields_.end() || !IsSet(key) || (*field)->is_empty) {
    throw ConfigError("--" + key, "is required; see --help");
  }
}

void Command::ApplyToml(const std::string& text, const std::string& origin, bool of_earlier_run) {
  toml::table table;
  try {
    table = toml::parse(text);
  } catch (const toml::parse_error& error) {
    const std::string reason(error.description());
    if (of_earlier_run) throw IoError(origin, "its options cannot be read: " + reason);
    throw ConfigError(origin + ":" + std::to_string(error.source().begin.line), reason);
  }
  ForEachKey(table, [&](const std::string& key, const toml::node& node) {
    const auto field = std::ranges::find(fields_, key, [](const auto& f) { return f->key; });
    if (field == fields_.end()) {
      if (of_earlier_run || IsRetired(key, TomlText(key, node))) return;
      std::vector<std::string> known;
      for (const auto& other : fields_) known.push_back(other->key);
      throw ConfigError(origin, "unknown key " + DescribeUnknownOption(key, known));
    }
    if (of_earlier_run && IsSet(key)) return;
    try {
      if (node.is_array() && !(*field)->is_list) throw ConfigError(key, "takes one value, no list");
      (*field)->set(TomlText(key, node));
    } catch (const ConfigError&) {
      // What another version wrote is no value of today; the stage itself says so where it matters.
      if (!of_earlier_run) throw;
    }
    if (!of_earlier_run) is_set_.insert(key);
  });
}

void Command::SetDefaults(const std::string& text, const std::string& origin) {
  ApplyToml(text, origin, true);
  for (const auto& validate : validators_) validate();
}

void Command::Apply() {
  if (!config_path_.empty()) ApplyToml(ReadFile(config_path_), config_path_, false);
  for (const auto& field : fields_) {
    if (!field->has_flag) continue;
    field->set(field->flag_text.empty() ? "" : field->flag_text.back());
    is_set_.insert(field->key);
  }
  for (const auto& validate : validators_) validate();
}

std::string Command::EffectiveToml(const std::vector<std::string>& left_out) const {
  std::string text = "# " + name_ + ", cairn " CAIRN_VERSION "\n";
  for (const Dumper& dumper : dumpers_) {
    if (!dumper.module.empty()) text += "\n[" + dumper.module + "]\n";
    text += dumper.dump();
  }
  for (const std::string& key : left_out) {
    const size_t begin = text.find("\n" + key + " = ");
    CAIRN_CHECK(begin != std::string::npos);
    text.erase(begin, text.find('\n', begin + 1) - begin);
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
    if (words.front().starts_with("-")) return "options go after the command; see --help";
    return "unknown command '" + words.front() + "'" + DidYouMean(words.front(), names);
  }
  if (error.get_exit_code() != static_cast<int>(CLI::ExitCodes::ExtrasError)) return error.what();
  const CLI::App* command = &app;
  if (!app.get_subcommands().empty()) {
    command = app.get_subcommands().front();
    if (!words.empty() && words.front().starts_with("-")) {
      return "options go after the command: " + app.get_name() + " " + command->get_name() + " " +
             words.front() + " ...";
    }
  }
  std::vector<std::string> known;
  for (const CLI::Option* option : command->get_options()) {
    known.push_back(option->get_name());
  }
  const std::vector<std::string> extras = app.remaining(true);
  if (extras.empty()) return error.what();
  const std::string flag = extras.front().substr(0, extras.front().find('='));
  return "unknown argument " + DescribeUnknownOption(flag, known);
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
    spdlog::error("{}", DescribeParseError(app_, error));
    return kExitUsage;
  }
}

}  // namespace cairn
