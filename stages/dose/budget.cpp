#include "stages/dose/budget.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::dose {
namespace {

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

/// As the job names it.
std::string_view key_of(std::size_t place, const Wishes& wishes, bool core) {
  if (place == 0) return core ? "--core-saturation" : "--saturation";
  if (place <= wishes.ranges.size()) return "dose.saturation_range";
  return core ? "part.core_saturation_percent" : "part.saturation_percent";
}

}  // namespace

void DoseFault::add(const Layer& layer, double asked_percent, double gets_percent, double asked_drops, bool worse) {
  const std::int64_t top = std::int64_t{layer.bottom} + layer.thickness;
  if (!where.empty() && gets_percent != gets) alike = false;
  if (where.empty() || worse) asked = asked_percent, gets = gets_percent, drops = asked_drops;
  if (!where.empty() && (where.back().last == layer.index || where.back().last == layer.index + 1)) {
    where.back().last = layer.index + 1;
    where.back().to_nm = top;
  } else {
    where.push_back({layer.index, layer.index + 1, layer.bottom, top});
  }
}

Budget::Budget(const Binder& binder, const PixelGrid& grid, std::optional<Wishes> wishes, std::uint32_t most_drops,
               double least_percent, const Jetting& jetting, Stretches stretches)
    : binder_(binder),
      grid_(grid),
      wishes_(std::move(wishes)),
      limit_(most_drops),
      least_percent_(least_percent),
      jetting_(jetting),
      stretches_(std::move(stretches)) {}

const LayerDose& Budget::dose(const Layer& layer, std::uint32_t zone) {
  const auto [found, fresh] = known_.try_emplace({wishes_ ? wishes_->place_of(layer, zone) : 0, layer.thickness});
  if (!fresh) return found->second;
  LayerDose& dose = found->second;
  if (wishes_) {
    dose = dose_of(layer, *wishes_, binder_, grid_, limit_, zone);
    if (!jetting_.dithered) round_drops(dose, binder_, grid_, layer.thickness);
  } else {
    dose = one_drop(jetting_.full_drops);
    dose.gets = dose.asked = saturation_of(jetting_.full_drops, binder_, grid_, layer.thickness);
    dose.gets_core = dose.asked_core = dose.gets * jetting_.core;
  }
  return dose;
}

void Budget::survey(std::vector<ZoneBox> boxes, std::uint32_t layers) {
  boxes_ = std::move(boxes);
  layers_ = layers;
}

void Budget::foresee(const Layer& layer, bool made) {
  made_ = made;
  for (std::uint32_t zone = 0; zone < (wishes_ ? wishes_->zones() : 1); ++zone) {
    if (!stretches_.any(zone, layer)) continue;
    if (wishes_ && wishes_->of(layer, zone).has_formula()) {
      const Wish& wish = wishes_->of(layer, zone);
      const bool differ = !(wish.percent == wish.of_core());
      if (jetting_.shell || !differ) look_at_field(layer, zone, false);
      if (differ && (!jetting_.shell || stretches_.core(zone, layer))) look_at_field(layer, zone, true);
      continue;
    }
    const LayerDose& of = dose(layer, zone);
    const bool differ = of.asked != of.asked_core;
    if (jetting_.shell || !differ) look_at(layer, zone, of, false, cut_);
    if (differ && (!jetting_.shell || stretches_.core(zone, layer))) look_at(layer, zone, of, true, cut_);
  }
}

void Budget::look_at(const Layer& layer, std::uint32_t zone, const LayerDose& dose, bool core, DoseFault& cut) {
  const double asked = core ? dose.asked_core : dose.asked, gets = core ? dose.gets_core : dose.gets;
  const Drops24 drops = core ? dose.core : dose.shell, asked_drops = core ? dose.asked_inside : dose.asked_shell;
  const double wish = static_cast<double>(asked_drops) / static_cast<double>(kOneDrop);
  most_drops_ = std::max(most_drops_, static_cast<std::uint32_t>((drops + kOneDrop - 1) >> kDropBits));
  const bool unbound = gets < least_percent_ * (1 - 1e-6);
  if (unbound) unbound_anywhere_.add(layer, asked, gets, wish, gets < unbound_anywhere_.gets);
  if (!made_) return;
  gets_ = seen_ ? std::pair(std::min(gets_.first, gets), std::max(gets_.second, gets)) : std::pair(gets, gets);
  seen_ = true;
  if (asked_drops > Drops24{limit_} << kDropBits) cut.add(layer, asked, gets, wish, asked > cut.asked);
  if (unbound) unbound_.add(layer, asked, gets, wish, gets < unbound_.gets);
  if (!wishes_) return;
  const std::size_t place = wishes_->place_of(layer, zone);
  if (drops == 0 && asked > 0) none_[{place, core}].add(layer, asked, gets, wish, false);
  if (place > wishes_->ranges.size()) jetted_[zone] |= drops > 0 || asked > 0;
}

FieldSurvey* Budget::survey_of(const std::string& formula, std::size_t place, std::uint32_t zone) {
  const auto found = surveys_.find({formula, zone});
  if (found != surveys_.end()) return &found->second;
  std::vector<ZoneBox> boxes;
  std::ranges::copy_if(boxes_, std::back_inserter(boxes), [&](const ZoneBox& box) { return box.zone == zone; });
  auto made = FieldSurvey::make(formula, grid_, std::move(boxes), place > wishes_->ranges.size(), layers_);
  if (made) return &surveys_.emplace(std::pair(formula, zone), std::move(*made)).first->second;
  if (!no_formula_) no_formula_ = Error{Fault::kUsage, made.error().message};
  return nullptr;
}

void Budget::look_at_field(const Layer& layer, std::uint32_t zone, bool core) {
  const Wish& wish = wishes_->of(layer, zone);
  const std::size_t place = wishes_->place_of(layer, zone);
  const Percent& percent = core ? wish.of_core() : wish.percent;
  FieldRange range{percent.value, percent.value, true};
  if (!percent.formula.empty()) {
    FieldSurvey* survey = survey_of(percent.formula, place, zone);
    if (survey != nullptr) range = survey->in(layer);
  }
  no_number_ |= made_ && !range.each;
  if (!range.any) return;  // where it meets a part it is told
  const DropScale scale(binder_, grid_, layer.thickness);
  const auto of = [&](double asked) {
    LayerDose dose;
    dose.asked = dose.asked_core = asked;
    dose.asked_shell = dose.asked_inside = scale.drops(asked);
    dose.shell = dose.core = std::min(dose.asked_shell, Drops24{limit_} << kDropBits);
    dose.gets = dose.gets_core = saturation_of(static_cast<double>(dose.shell) / kOneDrop, binder_, grid_, layer.thickness);
    if (!jetting_.dithered) round_drops(dose, binder_, grid_, layer.thickness);
    return dose;
  };
  const LayerDose least = of(range.least);
  if (made_ && least.gets < least_percent_ * (1 - 1e-6)) thin_.add(layer, least.asked, least.gets, 0, least.gets < thin_.gets);
  look_at(layer, zone, of(range.most), core, percent.formula.empty() ? cut_ : peaks_);
}

void Budget::warn_of_none(std::vector<Warning>& warnings) const {
  for (const auto& [of, fault] : none_) {
    warnings.push_back({"no-drop", fmt::format("{}: {} % is {:.2f} drops a pixel, which rounds to none in {}; leave out "
                                               "--no-dither, or ask for more",
                                               key_of(of.first, *wishes_, of.second), number_text(fault.asked), fault.drops,
                                               where(fault.where))});
  }
  for (const auto& [zone, jetted] : jetted_) {
    if (!jetted) warnings.push_back({"no-drop", "part.saturation_percent: 0: that part stays loose powder"});
  }
}

Status Budget::judge(bool allow_unbound, std::vector<Warning>& warnings) const {
  if (!cut_.where.empty()) {
    warnings.push_back({"saturation", fmt::format("--saturation: {:.1f} % needs more than the {} drops a pixel that may be "
                                                  "jetted, {} get {:.1f} %; thinner layers or larger drops reach it",
                                                  cut_.asked, limit_, where(cut_.where), cut_.gets)});
  }
  if (!peaks_.where.empty()) {
    warnings.push_back(
        {"saturation", fmt::format("--saturation: the formula comes to {:.1f} % somewhere in the boxes of the parts, "
                                   "which needs more than the {} drops a pixel that may be jetted; what lies "
                                   "there gets {:.1f} %, in {}",
                                   peaks_.asked, limit_, peaks_.gets, where(peaks_.where))});
  }
  warn_of_none(warnings);
  if (no_formula_) return *no_formula_;
  if (unbound_.where.empty() && !thin_.where.empty() && allow_unbound) {
    warnings.push_back(
        {"saturation", fmt::format("{} may get as little as {:.1f} % of their voids filled by their formula, and the "
                                   "powder binds from {} % on (powder.least_saturation_percent)",
                                   where(thin_.where), thin_.gets, number_text(least_percent_))});
  }
  const DoseFault& unbound = allow_unbound ? unbound_ : unbound_anywhere_;
  if (unbound.where.empty()) return {};
  const std::string asked = has_wish() ? fmt::format(" where {} % is asked", number_text(unbound.asked)) : "";
  const std::string text = fmt::format(
      "{} get {}{:.1f} % of their voids filled{}, and the powder binds from {} % on "
      "(powder.least_saturation_percent)",
      where(unbound.where), unbound.alike ? "" : "as little as ", unbound.gets, asked, number_text(least_percent_));
  if (!allow_unbound) {
    return Error{Fault::kUsage, fmt::format("{}: {}; give {} saturation, or --allow-unbound",
                                            has_wish() ? "--saturation" : "dose", text, has_wish() ? "a higher" : "a")};
  }
  warnings.push_back({"saturation", fmt::format("{}, parts may fall apart there", text)});
  return {};
}

void BinderCount::add(const Budget& budget, const Layer& layer, std::uint64_t dosed_pixels, std::uint64_t drops,
                      std::uint64_t asked_drops, std::uint64_t lost, std::uint32_t most_drops) {
  most_drops_ = std::max(most_drops_, most_drops);
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

}  // namespace lamina::dose
