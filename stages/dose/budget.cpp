#include "stages/dose/budget.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/data/text/number_text.h"
#include "stages/data/text/readable.h"

namespace lamina::dose {
namespace {

void add(const Layer& layer, double asked, double gets, std::vector<LayerSpan>& spans) {
  const std::int64_t top = std::int64_t{layer.bottom} + layer.thickness;
  if (!spans.empty() && (spans.back().last == layer.index || spans.back().last == layer.index + 1)) {
    spans.back().last = layer.index + 1;
    spans.back().to_nm = top;
    return;
  }
  spans.push_back({layer.index, layer.index + 1, layer.bottom, top, asked, gets});
}

/// "layers 3:9 (z 0.3 to 0.9 mm)", and how many others there are.
std::string where(const std::vector<LayerSpan>& spans) {
  std::uint32_t layers = 0;
  for (const LayerSpan& span : spans) layers += span.last - span.first;
  const LayerSpan& first = spans.front();
  std::string text =
      fmt::format("layers {}:{} (z {:.3f} to {:.3f} mm)", first.first, first.last, mm(first.from_nm), mm(first.to_nm));
  if (spans.size() > 1) text += fmt::format(" and {} more ranges, {} layers in all", spans.size() - 1, layers);
  return text;
}

}  // namespace

Budget::Budget(const Binder& binder, const PixelGrid& grid, std::optional<Wishes> wishes, std::uint32_t most_drops,
               double least_percent)
    : binder_(binder), grid_(grid), wishes_(std::move(wishes)), limit_(most_drops), least_percent_(least_percent) {}

const LayerDose& Budget::dose(const Layer& layer, std::uint32_t zone) {
  const auto [found, fresh] = known_.try_emplace({wishes_ ? wishes_->place_of(layer, zone) : 0, layer.thickness});
  if (!fresh) return found->second;
  LayerDose& dose = found->second;
  if (wishes_) {
    dose = dose_of(layer, *wishes_, binder_, grid_, limit_, zone);
  } else {
    dose = one_drop();
    dose.gets = dose.gets_core = dose.asked = dose.asked_core = saturation_of(1, binder_, grid_, layer.thickness);
  }
  return dose;
}

void Budget::foresee(const Layer& layer) {
  for (std::uint32_t zone = 0; zone < (wishes_ ? wishes_->zones() : 1); ++zone) {
    const LayerDose& of = dose(layer, zone);
    most_drops_ = std::max(most_drops_, of.most());
    const double least = std::min(of.gets, of.gets_core), most = std::max(of.gets, of.gets_core);
    gets_ = seen_ ? std::pair(std::min(gets_.first, least), std::max(gets_.second, most)) : std::pair(least, most);
    seen_ = true;
    if (of.cut) add(layer, std::max(of.asked, of.asked_core), most, cut_);
    if (least < least_percent_ * (1 - 1e-6)) add(layer, std::min(of.asked, of.asked_core), least, unbound_);
  }
}

Status Budget::judge(bool allow_unbound, std::vector<Warning>& warnings) const {
  if (!cut_.empty()) {
    warnings.push_back({"saturation", fmt::format("--saturation: {:.1f} % needs more than the {} drops a pixel that may be "
                                                  "jetted, {} get {:.1f} %; thinner layers or larger drops reach it",
                                                  cut_.front().asked, limit_, where(cut_), cut_.front().gets)});
  }
  if (unbound_.empty()) return {};
  const std::string text = fmt::format(
      "{} get {:.1f} % of their voids filled, and the powder binds from {} % on "
      "(powder.least_saturation_percent)",
      where(unbound_), unbound_.front().gets, number_text(least_percent_));
  if (!allow_unbound) {
    return Error{Fault::kUsage, fmt::format("{}: {}; give {} saturation, or --allow-unbound",
                                            has_wish() ? "--saturation" : "dose", text, has_wish() ? "a higher" : "a")};
  }
  warnings.push_back({"saturation", fmt::format("{}, parts may fall apart there", text)});
  return {};
}

void BinderCount::add(const Budget& budget, const Layer& layer, std::uint64_t dosed_pixels, std::uint64_t drops,
                      std::uint64_t asked_drops, std::uint64_t lost) {
  drops_ += drops - std::min(lost, drops);
  asked_drops_ += asked_drops;
  voids_pl_ += static_cast<double>(dosed_pixels) * dose::voids_pl(budget.binder(), budget.grid(), layer.thickness);
}

double BinderCount::binder_ml(const Budget& budget) const {
  return static_cast<double>(drops_) * budget.binder().drop_pl * 1e-9;
}

double BinderCount::asked_percent(const Budget& budget) const {
  const double stays = budget.binder().drop_pl * (1 - budget.binder().evaporates);
  return voids_pl_ > 0 ? 100 * static_cast<double>(asked_drops_) * stays / voids_pl_ : 0;
}

double BinderCount::reached_percent(const Budget& budget) const {
  const double stays = budget.binder().drop_pl * (1 - budget.binder().evaporates);
  return voids_pl_ > 0 ? 100 * static_cast<double>(drops_) * stays / voids_pl_ : 0;
}

std::string told(const Budget& budget, const BinderCount& count) {
  if (!budget.has_wish()) {
    const auto [least, most] = budget.gets();
    const std::string share = least == most ? fmt::format("{:.1f}", most) : fmt::format("{:.1f} to {:.1f}", least, most);
    return fmt::format("one drop of {} pl a pixel fills {} % of the voids", number_text(budget.binder().drop_pl), share);
  }
  return fmt::format("{:.2f} % of the voids reached, {:.2f} % asked; {} drops, {:.3f} ml of binder, up to {} a pixel",
                     count.reached_percent(budget), count.asked_percent(budget), readable_count(count.drops()),
                     count.binder_ml(budget), budget.most_drops());
}

}  // namespace lamina::dose
