#include "pipeline/machine/import/slicer_code.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "pipeline/job/errors.h"
#include "stages/support/text/formula.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

using NamePair = std::pair<std::string_view, std::string_view>;

constexpr std::size_t kMaxExpression = 400, kMaxValue = 200;

/// Names of PrusaSlicer and of Orca for what a job decides.
constexpr NamePair kPlaceholders[] = {{"first_layer_temperature", "{first_nozzle_degc}"},
                                      {"nozzle_temperature_initial_layer", "{first_nozzle_degc}"},
                                      {"temperature", "{nozzle_degc}"},
                                      {"nozzle_temperature", "{nozzle_degc}"},
                                      {"first_layer_bed_temperature", "{first_bed_degc}"},
                                      {"bed_temperature_initial_layer", "{first_bed_degc}"},
                                      {"bed_temperature_initial_layer_single", "{first_bed_degc}"},
                                      {"hot_plate_temp_initial_layer", "{first_bed_degc}"},
                                      {"bed_temperature", "{bed_degc}"},
                                      {"hot_plate_temp", "{bed_degc}"},
                                      {"total_layer_count", "{layers}"}};
constexpr NamePair kLayerPlaceholders[] = {{"layer_num", "{layer}"}, {"layer_z", "{z}"}};
/// lamina's printers have one extruder.
constexpr std::string_view kExtruderNumbers[] = {"initial_tool", "initial_extruder", "current_extruder",
                                                 "initial_no_support_extruder"};

bool is_word(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_'; }
bool begins_word(char c) { return is_word(c) && !(c >= '0' && c <= '9'); }

template <std::size_t N>
std::string_view find_pair(const NamePair (&pairs)[N], std::string_view name) {
  const auto found = std::ranges::find(pairs, name, &NamePair::first);
  return found == std::end(pairs) ? std::string_view() : found->second;
}

/// A setting with the number of an extruder: name, name[0], name[initial_tool], name_0.
struct IndexedName {
  std::string name;
  std::size_t index = 0;
  std::size_t length = 0;  // of its text
};

class CodeTranslator {
 public:
  CodeTranslator(std::string_view key, SlicerSettings& settings, std::vector<std::string>& notes)
      : key_(key), settings_(settings), notes_(notes) {}

  Result<std::string> translate(std::string_view code) {
    std::string text;
    for (std::size_t i = 0; i < code.size(); ++i) {
      const bool legacy = code[i] == '[' && i + 1 < code.size() && begins_word(code[i + 1]);
      if (code[i] != '{' && !legacy) {
        text += code[i];
        continue;
      }
      const std::size_t end = closing_of(code, i);
      if (end == std::string_view::npos || end - i > kMaxExpression) return wrong(code.substr(i, 40), "has no end");
      const std::string_view inner = trimmed(code.substr(i + 1, end - i - 1));
      const auto value = resolve(inner);
      if (!value) return value.error();
      text += *value;
      i = end;
    }
    return text;
  }

 private:
  static std::size_t closing_of(std::string_view code, std::size_t begin) {
    const char open = code[begin], close = open == '{' ? '}' : ']';
    std::size_t depth = 0;
    for (std::size_t i = begin; i < code.size(); ++i) {
      if (code[i] == open) ++depth;
      if (code[i] == close && --depth == 0) return i;
    }
    return std::string_view::npos;
  }

  Error wrong(std::string_view expression, std::string_view what) const {
    return usage("{}: '{}' {}; edit the code, or replace it by lamina's with --plain-code", key_, one_line(expression), what);
  }

  /// The name at the start of a text; nothing for an index that is no extruder's.
  std::optional<IndexedName> name_at(std::string_view text) const {
    IndexedName found;
    while (found.length < text.size() && is_word(text[found.length])) ++found.length;
    found.name = text.substr(0, found.length);
    if (found.length < text.size() && text[found.length] == '[') {
      const std::size_t end = text.find(']', found.length);
      if (end == std::string_view::npos) return std::nullopt;
      const std::string_view index = trimmed(text.substr(found.length + 1, end - found.length - 1));
      std::int64_t number = 0;
      if (std::ranges::find(kExtruderNumbers, index) == std::end(kExtruderNumbers) && !read_whole(index, 0, 99, number).empty())
        return std::nullopt;
      found.index = static_cast<std::size_t>(number);
      found.length = end + 1;
    } else if (found.name.ends_with("_0") && !settings_.has(found.name)) {
      found.name.resize(found.name.size() - 2);
    }
    return found;
  }

  std::string_view placeholder_of(const IndexedName& name) const {
    if (name.index > 0) return {};
    const std::string_view common = find_pair(kPlaceholders, name.name);
    return common.empty() && key_.find("layer") != std::string_view::npos ? find_pair(kLayerPlaceholders, name.name) : common;
  }

  Result<std::string> resolve(std::string_view expression) {
    for (const std::string_view word : {"if", "elsif", "else", "endif"}) {
      if (expression.starts_with(word) && (expression.size() == word.size() || !is_word(expression[word.size()])))
        return wrong(expression, "is a condition, which lamina's code has not");
    }
    const auto name = name_at(expression);
    if (name && !name->name.empty() && begins_word(name->name[0]) && name->length == expression.size()) {
      if (const std::string_view placeholder = placeholder_of(*name); !placeholder.empty()) return std::string(placeholder);
      if (std::ranges::find(kExtruderNumbers, name->name) != std::end(kExtruderNumbers)) return std::string("0");
      const auto value = settings_.element(name->name, name->index);
      if (!value || value->size() > kMaxValue || value->find_first_of("{}[]\n") != std::string::npos)
        return wrong(expression, "has no value before a job is planned");
      return *value;
    }
    return calculate(expression);
  }

  /// The value of arithmetic with the numbers of settings in place of their names.
  Result<std::string> calculate(std::string_view expression) {
    std::string formula;
    bool heats = false;
    for (std::size_t i = 0; i < expression.size();) {
      if (!begins_word(expression[i]) || (i > 0 && (is_word(expression[i - 1]) || expression[i - 1] == '.'))) {
        if (std::string_view("0123456789.+-*/(), eE").find(expression[i]) == std::string_view::npos)
          return wrong(expression, "is no sum or product of settings");
        formula += expression[i++];
        continue;
      }
      const auto name = name_at(expression.substr(i));
      if (!name) return wrong(expression, "has an index that is no extruder's");
      i += name->length;
      if (name->name == "min" || name->name == "max") {
        formula += name->name;
        continue;
      }
      const auto value = settings_.element(name->name, name->index);
      double number = 0;
      if (!value || !read_number(*value, -1e9, 1e9, "", number).empty())
        return wrong(expression, fmt::format("needs {}, which has no value before a job is planned", one_line(name->name)));
      heats = heats || !placeholder_of(*name).empty();
      formula += fmt::format("({})", number);
    }
    auto parsed = Formula::parse(formula, {});
    const auto value = parsed ? (*parsed)({}) : Result<double>(parsed.error());
    if (!value || !std::isfinite(*value)) return wrong(expression, "has no value");
    std::string text = plain_text(*value, 3);
    if (heats)
      notes_.push_back(
          fmt::format("{}: '{}' is {} for this filament, and so for every material", key_, one_line(expression), text));
    return text;
  }

  std::string_view key_;
  SlicerSettings& settings_;
  std::vector<std::string>& notes_;
};

/// Whether a line of the code begins with one of two commands, as "M104 S215".
bool has_command(std::string_view code, std::string_view one, std::string_view other) {
  for (std::string_view line : split(code, "\n")) {
    line = trimmed(line);
    for (const std::string_view command : {one, other}) {
      if (line.starts_with(command) && (line.size() == command.size() || !is_word(line[command.size()]))) return true;
    }
  }
  return false;
}

}  // namespace

Result<std::string> translate_code(std::string_view key, const std::string& code, SlicerSettings& settings,
                                   std::vector<std::string>& notes) {
  return CodeTranslator(key, settings, notes).translate(code);
}

std::string with_heating(const std::string& start) {
  std::string text = start;
  if (!text.empty() && text.back() != '\n') text += '\n';
  if (!has_command(start, "M104", "M109")) text = "M104 S{first_nozzle_degc}\n" + text + "M109 S{first_nozzle_degc}\n";
  if (!has_command(start, "M140", "M190")) text = "M190 S{first_bed_degc}\n" + text;
  return text;
}

}  // namespace lamina::pipeline
