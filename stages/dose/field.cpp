#include "stages/dose/field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/support/text/number_text.h"

namespace lamina::dose {
namespace {

constexpr std::uint64_t kMaxSamples = 8'000'000;  // of a job: about a second

std::int64_t middle(const PixelAxis& axis, std::uint32_t block) {
  const std::uint32_t first = block * kBlockSide, last = std::min(axis.count - 1, first + kBlockSide - 1);
  return (axis.centre(first) + axis.centre(last)) / 2;
}

std::int64_t beyond(std::int64_t low, std::int64_t high, std::int64_t at) {
  return std::max({std::int64_t{0}, low - at, at - high});
}

bool is_percent(double value) { return value >= 0 && value <= kMaxPercent; }  // no number is neither

}  // namespace

Result<Formula> parse_saturation(const std::string& text) {
  static constexpr std::string_view kNames[] = {"x", "y", "z"};
  return Formula::parse(text, kNames);
}

Status Field::start(const std::string& formula, std::string_view key, const Sheet& sheet, std::span<const ZoneBox> copies) {
  if (!formula_ || formula_->text() != formula) {
    auto parsed = parse_saturation(formula);
    if (!parsed) return Error{Fault::kUsage, fmt::format("{}: {}", key, parsed.error().message)};
    formula_.emplace(std::move(*parsed));
  }
  key_ = key;
  sheet_ = &sheet;
  fault_.reset();
  here_.clear();
  copies_ = !copies.empty();
  const Nm plane = sheet.layer.plane();
  std::int64_t nearest = INT64_MAX;
  for (const ZoneBox& box : copies) nearest = std::min(nearest, beyond(box.low[2], box.high[2], plane));
  for (const ZoneBox& box : copies) {
    if (beyond(box.low[2], box.high[2], plane) == nearest) here_.push_back(&box);
  }
  const bool one_z = std::ranges::all_of(here_, [&](const ZoneBox* box) { return box->origin[2] == here_[0]->origin[2]; });
  flat_ = !formula_->uses("x") && !formula_->uses("y") && (one_z || !formula_->uses("z"));
  const std::size_t blocks = flat_ ? 1 : sheet.grid.columns() / kBlockSide + 1;
  if (known_.size() < blocks) known_.resize(blocks, 0), drops_.resize(blocks);
  if (++stamp_ == 0) std::ranges::fill(known_, 0), stamp_ = 1;
  band_ = UINT32_MAX;
  return {};
}

void Field::begin_band(std::uint32_t row) {
  band_ = row;
  if (flat_) return;
  if (++stamp_ == 0) std::ranges::fill(known_, 0), stamp_ = 1;
  const std::int64_t y = middle(sheet_->grid.y, row);
  position_[1] = mm(y);
  near_.clear();
  const std::int64_t margin = 2 * kBlockSide * sheet_->grid.y.span / sheet_->grid.y.dots;
  for (const ZoneBox* box : here_) {
    if (beyond(box->low[1], box->high[1], y) <= margin) near_.push_back(box);
  }
  if (near_.empty()) near_ = here_;
}

Drops24 Field::evaluate(std::uint32_t column) {
  const std::size_t slot = flat_ ? 0 : column;
  if (flat_ && known_[0] == stamp_) return drops_[0];
  const std::int64_t x = middle(sheet_->grid.x, column), y = middle(sheet_->grid.y, band_);
  position_ = {mm(x), mm(y), mm(sheet_->layer.plane())};
  std::array<double, 3> at = position_;
  if (copies_) {
    const ZoneBox* own = nullptr;
    std::int64_t nearest = INT64_MAX;
    for (const ZoneBox* box : flat_ ? here_ : near_) {
      const std::int64_t far = beyond(box->low[0], box->high[0], x) + beyond(box->low[1], box->high[1], y);
      if (far < nearest) own = box, nearest = far;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) at[axis] -= mm(own->origin[axis]);
  }
  const Result<double> value = (*formula_)(at);
  if (!value && !fault_) fault_ = value.error();
  if (value && !is_percent(*value)) blame(*value, true);
  const Drops24 drops = value && is_percent(*value) ? sheet_->scale.drops(*value) : 0;
  const Drops24 gets = std::min(drops, sheet_->limit);
  if (!fault_ && (sheet_->dithered ? gets : rounded(gets)) < sheet_->minimum) blame(*value, false);
  known_[slot] = stamp_;
  return drops_[slot] = drops;
}

void Field::blame(double value, bool binds) {
  if (fault_) return;
  if (std::isnan(value)) value = std::abs(value);  // written without a sign
  const std::string where = fmt::format("{} '{}': is {:.6g} % in layer {} at x {:.3f}, y {:.3f}, z {:.3f} mm", key_,
                                        formula_->text(), value, sheet_->layer.index, position_[0], position_[1], position_[2]);
  const std::string what =
      binds ? fmt::format("; it has to be a number from 0 to {:g}: put it into max(0, ...)", kMaxPercent)
            : fmt::format(
                  ", and the powder binds from {} % on (powder.min_saturation_percent); give a higher saturation, or "
                  "--allow-unbound",
                  number_text(sheet_->min_percent));
  fault_ = Error{Fault::kUsage, where + what};
}

Result<FieldSurvey> FieldSurvey::make(const std::string& formula, const PixelGrid& grid, std::vector<ZoneBox> boxes, bool own,
                                      std::uint32_t layers) {
  auto parsed = parse_saturation(formula);
  if (!parsed) return parsed.error();
  FieldSurvey survey(std::move(*parsed), grid);
  survey.boxes_ = std::move(boxes);
  survey.own_ = own;
  survey.layers_ = std::max(1u, layers);
  return survey;
}

FieldRange FieldSurvey::in(const Layer& layer) {
  if (always_) return *always_;
  const bool by_height = formula_.uses("z");
  const auto met = [&](const ZoneBox& box) {
    return !by_height || (box.low[2] < std::int64_t{layer.bottom} + layer.thickness && box.high[2] > layer.bottom);
  };
  const auto boxes = static_cast<std::uint64_t>(std::max<std::ptrdiff_t>(1, std::ranges::count_if(boxes_, met)));
  const std::uint64_t maximum = std::max<std::uint64_t>(16, kMaxSamples / boxes / (by_height ? layers_ : 1));
  FieldRange found;
  for (const ZoneBox& box : boxes_) {
    if (met(box)) inspection(box, layer.plane(), maximum, found);
  }
  if (!by_height) always_ = found;
  return found;
}

void FieldSurvey::inspection(const ZoneBox& box, Nm plane, std::uint64_t maximum, FieldRange& found) {
  std::array<std::uint64_t, 2> first{}, blocks{}, samples{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const PixelAxis& along = axis == 0 ? grid_.x : grid_.y;
    const auto block = [&](std::int64_t at) {
      return static_cast<std::uint64_t>(std::clamp<std::int64_t>(along.first_at_or_beyond(at), 0, along.count - 1)) /
             kBlockSide;
    };
    first[axis] = block(box.low[axis]);
    blocks[axis] = block(box.high[axis]) - first[axis] + 1;
    samples[axis] = formula_.uses(axis == 0 ? "x" : "y") ? blocks[axis] : 1;
  }
  if (samples[0] * samples[1] > maximum) {
    const double side = std::sqrt(static_cast<double>(maximum));
    const std::size_t small = samples[0] < samples[1] ? 0 : 1, large = 1 - small;
    samples[small] = std::min(samples[small], std::max<std::uint64_t>(2, static_cast<std::uint64_t>(side)));
    samples[large] = std::min(samples[large], std::max<std::uint64_t>(2, maximum / samples[small]));
  }
  const auto nth = [&](std::size_t axis, std::uint64_t i) {
    const std::uint64_t at = samples[axis] == 1 ? blocks[axis] / 2 : i * (blocks[axis] - 1) / (samples[axis] - 1);
    return middle(axis == 0 ? grid_.x : grid_.y, static_cast<std::uint32_t>(first[axis] + at));
  };
  std::array<double, 3> at{0, 0, mm(plane - (own_ ? box.origin[2] : 0))};
  for (std::uint64_t j = 0; j < samples[1]; ++j) {
    at[1] = mm(nth(1, j) - (own_ ? box.origin[1] : 0));
    for (std::uint64_t i = 0; i < samples[0]; ++i) {
      at[0] = mm(nth(0, i) - (own_ ? box.origin[0] : 0));
      const Result<double> value = formula_(at);
      if (!value || !is_percent(*value)) {
        found.each = false;
        continue;
      }
      found.minimum = found.any ? std::min(found.minimum, *value) : *value;
      found.maximum = found.any ? std::max(found.maximum, *value) : *value;
      found.any = true;
    }
  }
}

}  // namespace lamina::dose
