#include "stages/heights/thickness_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/support/text/number_text.h"
#include "stages/support/text/value.h"

namespace lamina::heights {
namespace {

constexpr std::size_t kMaxThicknesses = 10'000;
constexpr double kDefaultStepMm = 0.001;

Error refused(std::string what) { return {Fault::kUsage, std::move(what)}; }

Status read_nm(std::string_view text, Nm& nm) {
  double millimetres = 0;
  if (auto wrong = read_number(text, kMinMm, kMaxMm, " mm", millimetres); !wrong.empty()) return refused(std::move(wrong));
  nm = static_cast<Nm>(std::llround(millimetres * static_cast<double>(kNmPerMm)));
  return {};
}

Result<ThicknessSet> read_range(std::string_view text, std::size_t dots) {
  const std::size_t colon = std::min(text.find(':', dots), text.size());
  Nm low = 0, high = 0, step = static_cast<Nm>(kDefaultStepMm * kNmPerMm);
  if (const Status read = read_nm(text.substr(0, dots), low); !read) return read.error();
  if (const Status read = read_nm(text.substr(dots + 2, colon - dots - 2), high); !read) return read.error();
  if (colon < text.size()) {
    if (const Status read = read_nm(text.substr(colon + 1), step); !read) return read.error();
  }
  if (low > high) {
    return refused(fmt::format("the least thickness, {} mm, is above the greatest, {} mm; write the smaller one first", mm(low),
                               mm(high)));
  }
  if ((high - low) / step >= static_cast<Nm>(kMaxThicknesses)) {
    return refused(fmt::format("'{}' is more than {} thicknesses; give a coarser step, as {}..{}:{}", text, kMaxThicknesses,
                               mm(low), mm(high), mm((high - low) / 1000 + 1)));
  }
  if (const Nm rest = (high - low) % step; rest != 0) {
    return refused(fmt::format(
        "'{}': steps of {} mm from {} mm end at {} mm and miss {} mm; end there, choose a step that divides the range, or give a "
        "set as 0.178,0.254",
        text, mm(step), mm(low), mm(high - rest), mm(high)));
  }
  ThicknessSet set;
  for (std::int64_t value = low; value <= high; value += step) set.values.push_back(static_cast<Nm>(value));
  return set;
}

}  // namespace

Result<ThicknessSet> read_thicknesses(std::string_view text) {
  if (text.empty()) return refused("holds no thickness; give a set as 0.178,0.254 or a range as 0.05..0.3:0.01");
  if (const std::size_t dots = text.find(".."); dots != std::string_view::npos) return read_range(text, dots);
  ThicknessSet set;
  for (const std::string_view piece : split(text, ",")) {
    if (const Status read = read_nm(piece, set.values.emplace_back()); !read) return read.error();
  }
  if (set.values.size() > kMaxThicknesses) {
    return refused(fmt::format("holds {} thicknesses; {} are enough", set.values.size(), kMaxThicknesses));
  }
  std::ranges::sort(set.values);
  if (const auto twice = std::ranges::adjacent_find(set.values); twice != set.values.end()) {
    return refused(fmt::format("holds {} mm twice; leave one out", mm(*twice)));
  }
  return set;
}

}  // namespace lamina::heights
