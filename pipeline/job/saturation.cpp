// Saturations of a job: numbers or formulas, and the list dose.saturation_range.
#include <fmt/format.h>

#include <optional>

#include "pipeline/job/keys.h"
#include "stages/dose/field.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/ranges.h"

namespace lamina::pipeline {
namespace {

/// A wish of which each part may be left out.
struct RangeWish {
  std::optional<Saturation> percent, core;
};

constexpr Key<RangeWish> kRangeKeys[] = {
    structure<read_saturation, saturation_text, &RangeWish::percent>({"saturation_range", "saturation_percent"}),
    structure<read_saturation, saturation_text, &RangeWish::core>({"saturation_range", "core_saturation_percent"}),
};

}  // namespace

std::string read_saturation(const TomlValue& value, std::optional<Saturation>& percent, Place&) {
  if (!value.is_text()) return "is not a number of per cent or a formula of x, y and z";
  const std::string& text = value.text;
  const bool number = !text.empty() && text.find_first_not_of("0123456789.+-eE_") == std::string::npos;
  double read = 0;
  const std::string wrong = read_value(text, Limits{0, dose::kMostPercent, " %"}, read);
  if (wrong.empty()) {
    percent = read;
    return {};
  }
  constexpr std::size_t kLongest = 1000;
  double any = 0;
  if (text.empty() || (number && read_value(text, Limits{-1e300, 1e300}, any).empty())) return wrong;
  if (text.size() > kLongest) return fmt::format("is a formula of {} characters, at most {} are read", text.size(), kLongest);
  if (const auto parsed = dose::parse_saturation(text); !parsed) return parsed.error().message;
  percent = Saturation::of(text);
  return {};
}

std::string saturation_text(const std::optional<Saturation>& percent) {
  if (!percent) return {};
  return percent->formula.empty() ? number_text(percent->percent) : toml_string(percent->formula);
}

std::string read_saturation_ranges(const TomlValue& list, std::vector<SaturationRange>& ranges, Place& at) {
  if (auto wrong = check_tables(list, "from_mm, to_mm and saturation_percent"); !wrong.empty()) return wrong;
  std::vector<SaturationRange> read;
  for (TomlValue table : list.value) {
    SaturationRange& range = read.emplace_back();
    at = table.place;
    if (auto wrong = take_ends(table, range.from_mm, range.to_mm, at); !wrong.empty()) return wrong;
    RangeWish wish;
    if (auto wrong = read_table<RangeWish>(table, "saturation_range", kRangeKeys, wish, at); !wrong.empty()) return wrong;
    if (!wish.percent) return fmt::format("{}: saturation_percent is missing", range_name(range.from_mm, range.to_mm));
    range.percent = *wish.percent;
    range.core_percent = wish.core;
  }
  ranges = std::move(read);
  return {};
}

std::string saturation_ranges_text(const std::vector<SaturationRange>& ranges) {
  std::string text;
  for (const auto& [from, to, percent, core] : ranges) {
    text += fmt::format("{}{{ from_mm = {}, to_mm = {}, saturation_percent = {}", text.empty() ? "" : ", ", number_text(from),
                        number_text(to), saturation_text(percent));
    if (core) text += fmt::format(", core_saturation_percent = {}", saturation_text(core));
    text += " }";
  }
  return text.empty() ? text : fmt::format("[{}]", text);
}

}  // namespace lamina::pipeline
