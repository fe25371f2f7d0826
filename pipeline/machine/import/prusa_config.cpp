#include "pipeline/machine/import/prusa_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "pipeline/job/errors.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

constexpr std::size_t kDeepestSection = 32, kMaxInherited = 200'000, kMaxNames = 60;

/// Settings of a file in their order; views of its text.
struct ConfigSection {
  std::vector<std::pair<std::string_view, std::string_view>> settings;
  std::string_view find(std::string_view key) const {
    std::string_view value;
    for (const auto& [name, text] : settings) {
      if (name == key) value = text;
    }
    return value;
  }
};

struct ConfigFile {
  ConfigSection head;  // before the first section
  std::map<std::string_view, ConfigSection> section;
};

Result<ConfigFile> parse_config(std::string_view text, const std::string& where) {
  ConfigFile file;
  ConfigSection* section = &file.head;
  std::size_t number = 0;
  if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);
  while (!text.empty()) {
    const std::string_view whole = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(whole.size() + 1, text.size()));
    ++number;
    std::string_view line = trimmed(whole.ends_with('\r') ? whole.substr(0, whole.size() - 1) : whole);
    if (line.empty() || line.front() == '#' || line.front() == ';') continue;
    if (line.front() == '[' && line.back() == ']') {
      section = &file.section[line.substr(1, line.size() - 2)];
      continue;
    }
    const std::size_t equals = line.find('=');
    const std::string_view key = trimmed(line.substr(0, equals));
    if (equals == std::string_view::npos || key.empty())
      return failure(Fault::kInput, "{}:{}: '{}' is not key = value; export the configuration again", where, number,
                     one_line(line.substr(0, 40)));
    section->settings.emplace_back(key, trimmed(line.substr(equals + 1)));
  }
  return file;
}

/// Code on one line: \n, \r, \" and \\ are escapes.
std::string without_escapes(std::string_view code) {
  std::string text;
  for (std::size_t i = 0; i < code.size(); ++i) {
    const bool escape = code[i] == '\\' && i + 1 < code.size();
    const char c = escape ? code[++i] : code[i];
    if (escape && c == 'r') continue;
    text += escape && c == 'n' ? '\n' : c;
  }
  return text;
}

void add_settings(const ConfigSection& section, SlicerSettings& settings) {
  for (const auto& [key, value] : section.settings) {
    if (key == "inherits") continue;
    settings.set(key, key.ends_with("_gcode") ? without_escapes(unquoted(value)) : std::string(value));
  }
}

/// The sections of one kind, as "printer".
class BundleReader {
 public:
  BundleReader(const ConfigFile& file, const std::string& where, std::string_view kind)
      : file_(file), where_(where), kind_(kind) {}

  const ConfigSection* find(std::string_view name) const {
    const auto found = file_.section.find(fmt::format("{}:{}", kind_, name));
    return found == file_.section.end() ? nullptr : &found->second;
  }

  /// Adds the settings of a section over those that it inherits. errors  kUsage
  Status add(std::string_view name, SlicerSettings& settings) {
    const ConfigSection* section = find(name);
    if (section == nullptr) return usage("{}: [{}:{}]: inherits: no such section", where_, kind_, one_line(name));
    const bool again = std::ranges::find(chain_, name) != chain_.end();
    chain_.push_back(name);
    if (again) return usage("{}: [{}:{}]: inherits goes round in a circle: {}", where_, kind_, one_line(name), chain_text());
    if (chain_.size() > kDeepestSection)
      return usage("{}: [{}:{}]: inherits over more than {} sections", where_, kind_, one_line(name), kDeepestSection);
    for (const std::string_view base : split(section->find("inherits"), ";")) {
      if (trimmed(base).empty()) continue;
      if (Status status = add(trimmed(base), settings); !status) return status;
    }
    added_ += section->settings.size() + 1;
    if (added_ > kMaxInherited)
      return usage("{}: [{}:{}]: inherits more than {} settings", where_, kind_, one_line(name), kMaxInherited);
    add_settings(*section, settings);
    chain_.pop_back();
    return {};
  }

  /// Without those that are bases alone.
  std::vector<std::string_view> names() const {
    std::vector<std::string_view> names;
    const std::string prefix = fmt::format("{}:", kind_);
    for (const auto& [name, section] : file_.section) {
      if (name.starts_with(prefix) && !name.substr(prefix.size()).starts_with('*')) names.push_back(name.substr(prefix.size()));
    }
    return names;
  }

  std::string names_text() const {
    const std::vector<std::string_view> all = names();
    std::string text;
    for (std::size_t i = 0; i < std::min(all.size(), kMaxNames); ++i)
      text += fmt::format("{}'{}'", i == 0 ? "" : ", ", one_line(all[i]));
    if (all.size() > kMaxNames) text += fmt::format(" and {} more", all.size() - kMaxNames);
    return text;
  }

 private:
  std::string chain_text() const {
    std::string text;
    for (const std::string_view name : chain_) text += (text.empty() ? "" : " > ") + one_line(name);
    return text;
  }

  const ConfigFile& file_;
  const std::string& where_;
  std::string_view kind_;
  std::vector<std::string_view> chain_;
  std::size_t added_ = 0;
};

/// The first name of a list that PrusaSlicer keeps in quotes.
std::string first_name(std::string_view list) {
  list = trimmed(list);
  if (!list.starts_with('"')) return std::string(trimmed(list.substr(0, list.find(';'))));
  return std::string(list.substr(1, list.find('"', 1) - 1));
}

/// errors  kUsage, with the known names
Status check_choice(const BundleReader& sections, const std::string& name, std::string_view flag, const std::string& where) {
  if (!name.empty() && !name.starts_with('*') && sections.find(name) != nullptr) return {};
  const std::vector<std::string_view> names = sections.names();
  if (names.empty())
    return usage("{}: has no section [{}:NAME]; name an exported configuration or a bundle of PrusaSlicer", where,
                 flag.substr(2));
  if (name.empty()) return usage("{}: has several printers; name one with --printer: {}", where, sections.names_text());
  return usage("{} '{}': {} has no such section{}; use one of {}", flag, one_line(name), where, suggest(name, names),
               sections.names_text());
}

Result<PrusaConfig> read_bundle(const ConfigFile& file, const std::string& where, const BundleChoice& choice) {
  PrusaConfig config;
  config.name = choice.printer;
  BundleReader printers(file, where, "printer"), filaments(file, where, "filament"), prints(file, where, "print");
  if (Status status = check_choice(printers, choice.printer, "--printer", where); !status) return status.error();
  SlicerSettings printer;
  if (Status status = printers.add(choice.printer, printer); !status) return status.error();
  const std::string print = first_name(printer.text("default_print_profile").value_or("")),
                    usual = first_name(printer.text("default_filament_profile").value_or("")),
                    filament = choice.filament.empty() ? usual : choice.filament;
  if (!choice.filament.empty()) {
    if (Status status = check_choice(filaments, filament, "--filament", where); !status) return status.error();
  }
  const auto add = [&](BundleReader& sections, const std::string& name, std::string_view what) -> Status {
    if (!name.empty() && sections.find(name) != nullptr) return sections.add(name, config.settings);
    config.notes.push_back(fmt::format("{}: the values are lamina's defaults",
                                       name.empty() ? fmt::format("the printer names no {}", what)
                                                    : fmt::format("{} '{}' is not in the file", what, one_line(name))));
    return {};
  };
  if (Status status = add(prints, print, "print profile"); !status) return status.error();
  if (Status status = add(filaments, filament, "filament"); !status) return status.error();
  config.settings.update(printer);
  config.settings.set("printer_settings_id", choice.printer);
  config.settings.set("filament_settings_id", filament);
  config.settings.set("print_settings_id", print);
  for (const char* id : {"printer_settings_id", "filament_settings_id", "print_settings_id"})
    static_cast<void>(config.settings.text(id));
  return config;
}

}  // namespace

Result<PrusaConfig> read_prusa_config(std::string_view text, const std::string& where, const BundleChoice& choice) {
  if (text.find('\0') != std::string_view::npos)
    return usage("{}: is no file of settings: it has bytes that are no text", where);
  const auto file = parse_config(text, where);
  if (!file) return file.error();
  if (!file->section.empty()) return read_bundle(*file, where, choice);
  for (const auto& [flag, name] : {std::pair{"--printer", &choice.printer}, {"--filament", &choice.filament}}) {
    if (!name->empty()) return usage("{}: {} has the settings of one printer, and no sections; leave it out", flag, where);
  }
  PrusaConfig config;
  add_settings(file->head, config.settings);
  config.name = config.settings.element("printer_settings_id").value_or("");
  return config;
}

}  // namespace lamina::pipeline
