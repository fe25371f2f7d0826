#include "stages/support/text/key.h"

#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"

namespace lamina {
namespace {

/// Keys of job files and profiles that have another name since version 0.1.0.
/// Section, old key, key of today. An empty key names a section that was renamed.
constexpr std::string_view kRenamedKeys[][3] = {
    {"fill", "by_height", "fill.range"},
    {"segment", "by_height", "segment.range"},
    {"segment", "least_end_mm", "segment.min_end_mm"},
    {"part", "material_by_height", "part.material_range"},
    {"extrude", "set", "extrude.machine"},
    {"run", "least_wall_mm", "run.min_wall_mm"},
    {"head", "most_drops", "head.max_drops"},
    {"head", "most_drop_sweeps", "head.max_drop_sweeps"},
    {"powder", "least_saturation_percent", "powder.min_saturation_percent"},
    {"skirt", "least_mm", "skirt.min_mm"},
    {"retraction", "least_travel_mm", "retraction.min_travel_mm"},
    {"place", "", "placement"},
    {"care", "", "maintenance"},
};

}  // namespace

std::string no_such_key(std::string_view section, std::string_view name, std::span<const std::string_view> names) {
  for (const auto& [of, old, now] : kRenamedKeys) {
    if (of == section && old == name) return fmt::format("is now {}; see docs/reference/job.md", now);
  }
  const std::string near = suggest(name, names);
  return near.empty() ? fmt::format("no such key; [{}] has {}", section, fmt::join(names, ", "))
                      : fmt::format("no such key{}", near);
}

std::string no_such_section(std::string_view section, std::span<const std::string_view> names) {
  for (const auto& [of, old, now] : kRenamedKeys) {
    if (of == section && old.empty()) return fmt::format("is now [{}]; see docs/reference/job.md", now);
  }
  const std::string near = suggest(section, names);
  return near.empty() ? fmt::format("no such section; there are {}", fmt::join(names, ", "))
                      : fmt::format("no such section{}", near);
}

std::string key_line(std::string_view name, Form form, std::string_view text) {
  if (form == Form::kString) return fmt::format("{} = {}", name, toml_string(text));
  if (form == Form::kBare || form == Form::kToml) return fmt::format("{} = {}", name, text);
  std::string list;
  for (const std::string_view piece : text.empty() ? std::vector<std::string_view>() : split(text, ",")) {
    list += (list.empty() ? "" : ", ") + (form == Form::kStrings ? toml_string(piece) : std::string(piece));
  }
  return fmt::format("{} = [{}]", name, list);
}

std::string range_name(double from_mm, double to_mm) { return fmt::format("{}:{}", number_text(from_mm), number_text(to_mm)); }

std::string take_ends(TomlValue& table, double& from_mm, double& to_mm, TextPosition& at) {
  for (const auto& [name, end] : {std::pair{"from_mm", &from_mm}, {"to_mm", &to_mm}}) {
    at = table.position;
    const TomlValue* value = table.find(name);
    if (value == nullptr) return fmt::format("{} is missing; give both ends, from_mm and to_mm", name);
    at = value->position;
    if (!value->is_text()) return fmt::format("{}: is not a number", name);
    if (auto wrong = read_number(value->text, 0, kMaxMm, " mm", *end); !wrong.empty())
      return fmt::format("{}: {}", name, wrong);
    table.remove(name);
  }
  if (from_mm < to_mm) return {};
  return fmt::format("{} ends at or below its start; write the lower height as from_mm", range_name(from_mm, to_mm));
}

std::string check_tables(const TomlValue& value, std::string_view example) {
  if (value.is_list() && std::ranges::all_of(value.value, &TomlValue::is_table)) return {};
  return fmt::format("is an array of tables, each with {}", example);
}

}  // namespace lamina
