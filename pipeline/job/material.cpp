#include "pipeline/job/job.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/job/job.h"
#include "pipeline/job/keys.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/support/text/key.h"
#include "stages/support/text/ranges.h"

namespace lamina::pipeline {
namespace {

constexpr Key<MaterialRange> kMaterialKeys[] = {
    text<read::check_material, &MaterialRange::material>({"material_range", "material"})};

}  // namespace

Status set_materials(std::string_view text, Job& job) {
  const auto names = split(text, ",");
  if (names.size() != 1 && names.size() != job.parts.size()) {
    return Error{Fault::kUsage,
                 fmt::format("{} names for {} parts; give one for all or one for each", names.size(), job.parts.size())};
  }
  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    const auto name = names[names.size() == 1 ? 0 : p];
    if (const std::string what = read::check_material(name); !what.empty()) return Error{Fault::kUsage, what};
    job.parts[p].material = name;
  }
  return {};
}

std::string read_material_ranges(const TomlValue& list, std::vector<MaterialRange>& ranges, Place& at) {
  if (auto wrong = check_tables(list, "from_mm, to_mm and material"); !wrong.empty()) return wrong;
  std::vector<MaterialRange> read;
  for (TomlValue table : list.value) {
    MaterialRange& range = read.emplace_back();
    at = table.place;
    if (auto wrong = take_ends(table, range.from_mm, range.to_mm, at); !wrong.empty()) return wrong;
    if (auto wrong = read_table<MaterialRange>(table, "material_range", kMaterialKeys, range, at); !wrong.empty()) return wrong;
    if (range.material.empty()) return fmt::format("{}: material is missing", range_name(range.from_mm, range.to_mm));
  }
  ranges = std::move(read);
  return {};
}

std::string material_ranges_text(const std::vector<MaterialRange>& ranges) {
  std::string text;
  for (const auto& [from, to, material] : ranges) {
    text += fmt::format("{}{{ from_mm = {}, to_mm = {}, material = {} }}", text.empty() ? "" : ", ", number_text(from),
                        number_text(to), toml_string(material));
  }
  return text.empty() ? text : fmt::format("[{}]", text);
}

}  // namespace lamina::pipeline
