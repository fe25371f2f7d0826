#include "stages/dose/budget.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <numeric>

#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::dose {
namespace {

/// How wide all is that a box is part of, along an axis, where boxes closer than `gap` are one.
std::vector<std::int64_t> widths(std::span<const ZoneBox> boxes, std::size_t axis, std::int64_t gap) {
  std::vector<std::uint32_t> order(boxes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::sort(order, {}, [&](std::uint32_t i) { return boxes[i].low[axis]; });
  std::vector<std::int64_t> width(boxes.size());
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    const std::int64_t low = boxes[order[begin]].low[axis];
    std::int64_t high = boxes[order[begin]].high[axis];
    for (; end < order.size() && boxes[order[end]].low[axis] <= high + gap; ++end)
      high = std::max(high, boxes[order[end]].high[axis]);
    for (std::size_t i = begin; i < end; ++i) width[order[i]] = high - low;
  }
  return width;
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

/// As the job names it.
std::string_view key_of(std::size_t position, const DoseTargets& targets, bool core) {
  if (position == 0) return core ? "--core-saturation" : "--saturation";
  if (position <= targets.ranges.size()) return "dose.saturation_range";
  return core ? "part.core_saturation_percent" : "part.saturation_percent";
}

}  // namespace

CoveredSpans::CoveredSpans(std::span<const ZoneBox> boxes, std::uint32_t zones, std::int64_t shell_nm, std::int64_t pixel_nm)
    : everywhere_(false), all_(zones), core_(zones) {
  // A pixel more at either end of a box, and a reach that is rounded down to pixels.
  const std::int64_t margin = 4 * pixel_nm;
  const std::vector<std::int64_t> along_x = widths(boxes, 0, margin), along_y = widths(boxes, 1, margin);
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    const ZoneBox& box = boxes[i];
    all_[box.zone].push_back({box.low[2], box.high[2]});
    if (std::min(along_x[i], along_y[i]) + margin > 2 * shell_nm) core_[box.zone].push_back({box.low[2], box.high[2]});
  }
  std::ranges::for_each(all_, merge);
  std::ranges::for_each(core_, merge);
}

void CoveredSpans::merge(Spans& spans) {
  std::ranges::sort(spans, {}, &Span::from);
  std::size_t kept = 0;
  for (std::size_t i = 1; i < spans.size(); ++i) {
    if (spans[i].from <= spans[kept].to) {
      spans[kept].to = std::max(spans[kept].to, spans[i].to);
    } else {
      spans[++kept] = spans[i];
    }
  }
  if (!spans.empty()) spans.resize(kept + 1);
}

bool CoveredSpans::meets(const Spans& spans, const Layer& layer) {
  const auto above =
      std::ranges::upper_bound(spans, std::int64_t{layer.bottom}, {}, &Span::to);  // ends above the layer's bottom
  return above != spans.end() && above->from < std::int64_t{layer.bottom} + layer.thickness;
}

void DoseFault::add(const Layer& layer, double requested_percent, double gets_percent, double requested_drops, bool worse) {
  if (!where.empty() && gets_percent != gets) alike = false;
  if (where.empty() || worse) requested = requested_percent, gets = gets_percent, drops = requested_drops;
  if (where.empty() || (where.back().last != layer.index && where.back().last != layer.index + 1))
    where.push_back({layer.index, 0, layer.bottom, 0});
  where.back().last = layer.index + 1;
  where.back().to_nm = std::int64_t{layer.bottom} + layer.thickness;
}

Budget::Budget(const Binder& binder, const PixelGrid& grid, std::optional<DoseTargets> targets, std::uint32_t max_drops,
               double min_percent, const Jetting& jetting, CoveredSpans covered)
    : binder_(binder),
      grid_(grid),
      targets_(std::move(targets)),
      limit_(max_drops),
      min_percent_(min_percent),
      jetting_(jetting),
      spans_(std::move(covered)) {}

const LayerDose& Budget::dose(const Layer& layer, std::uint32_t zone) {
  const auto [found, fresh] = known_.try_emplace({targets_ ? targets_->target_index(layer, zone) : 0, layer.thickness});
  if (!fresh) return found->second;
  LayerDose& dose = found->second;
  if (targets_) {
    dose = dose_of(layer, *targets_, binder_, grid_, limit_, zone);
    if (!jetting_.dithered) round_drops(dose, binder_, grid_, layer.thickness);
  } else {
    dose = one_drop(jetting_.full_drops);
    dose.gets = dose.requested = saturation_of(jetting_.full_drops, binder_, grid_, layer.thickness);
    dose.gets_core = dose.requested_core = dose.gets * jetting_.core;
  }
  return dose;
}

void Budget::foresee(const Layer& layer, bool made) {
  made_ = made;
  for (std::uint32_t zone = 0; zone < (targets_ ? targets_->zones() : 1); ++zone) {
    if (!spans_.any(zone, layer)) continue;
    const DoseTarget* const target = targets_ ? &targets_->of(layer, zone) : nullptr;
    const LayerDose* const of = target == nullptr || !target->has_formula() ? &dose(layer, zone) : nullptr;
    const bool differ = of != nullptr ? of->requested != of->requested_core : !(target->percent == target->of_core());
    for (const bool core : {false, true}) {
      if (core ? !differ || (jetting_.shell && !spans_.core(zone, layer)) : differ && !jetting_.shell) continue;
      of != nullptr ? check_dose(layer, zone, *of, core, cut_) : inspect_field(layer, zone, core);
    }
  }
}

void Budget::check_dose(const Layer& layer, std::uint32_t zone, const LayerDose& dose, bool core, DoseFault& cut) {
  const double requested = core ? dose.requested_core : dose.requested, gets = core ? dose.gets_core : dose.gets;
  const Drops24 drops = core ? dose.core : dose.shell, requested_drops = core ? dose.requested_inside : dose.requested_shell;
  const double target = static_cast<double>(requested_drops) / static_cast<double>(kOneDrop);
  max_drops_ = std::max(max_drops_, static_cast<std::uint32_t>((drops + kOneDrop - 1) >> kDropBits));
  const bool unbound = gets < min_percent_ * (1 - 1e-6);
  if (unbound) unbound_anywhere_.add(layer, requested, gets, target, gets < unbound_anywhere_.gets);
  if (!made_) return;
  gets_ = any_ ? std::pair(std::min(gets_.first, gets), std::max(gets_.second, gets)) : std::pair(gets, gets);
  any_ = true;
  if (requested_drops > Drops24{limit_} << kDropBits) cut.add(layer, requested, gets, target, requested > cut.requested);
  if (unbound) unbound_.add(layer, requested, gets, target, gets < unbound_.gets);
  if (!targets_) return;
  const std::size_t position = targets_->target_index(layer, zone);
  if (drops == 0 && requested > 0) none_[{position, core}].add(layer, requested, gets, target, false);
  if (position > targets_->ranges.size()) jetted_[zone] |= drops > 0 || requested > 0;
}

FieldSurvey* Budget::survey_of(const std::string& formula, std::size_t position, std::uint32_t zone) {
  const auto found = surveys_.find({formula, zone});
  if (found != surveys_.end()) return &found->second;
  std::vector<ZoneBox> boxes;
  std::ranges::copy_if(boxes_, std::back_inserter(boxes), [&](const ZoneBox& box) { return box.zone == zone; });
  auto made = FieldSurvey::make(formula, grid_, std::move(boxes), position > targets_->ranges.size(), layers_);
  if (made) return &surveys_.emplace(std::pair(formula, zone), std::move(*made)).first->second;
  if (!no_formula_) no_formula_ = Error{Fault::kUsage, made.error().message};
  return nullptr;
}

void Budget::inspect_field(const Layer& layer, std::uint32_t zone, bool core) {
  const DoseTarget& target = targets_->of(layer, zone);
  const std::size_t position = targets_->target_index(layer, zone);
  const Saturation& wanted = core ? target.of_core() : target.percent;
  FieldRange range{wanted.percent, wanted.percent, true};
  if (!wanted.formula.empty()) {
    FieldSurvey* survey = survey_of(wanted.formula, position, zone);
    if (survey != nullptr) range = survey->in(layer);
  }
  no_number_ |= made_ && !range.each;
  if (!range.any) return;  // where it meets a part it is reported
  const DropScale scale(binder_, grid_, layer.thickness);
  const auto of = [&](double requested) {
    LayerDose dose;
    dose.requested = dose.requested_core = requested;
    dose.requested_shell = dose.requested_inside = scale.drops(requested);
    dose.shell = dose.core = std::min(dose.requested_shell, Drops24{limit_} << kDropBits);
    dose.gets = dose.gets_core = saturation_of(static_cast<double>(dose.shell) / kOneDrop, binder_, grid_, layer.thickness);
    if (!jetting_.dithered) round_drops(dose, binder_, grid_, layer.thickness);
    return dose;
  };
  const LayerDose minimum = of(range.minimum);
  if (made_ && minimum.gets < min_percent_ * (1 - 1e-6))
    thin_.add(layer, minimum.requested, minimum.gets, 0, minimum.gets < thin_.gets);
  check_dose(layer, zone, of(range.maximum), core, wanted.formula.empty() ? cut_ : peaks_);
}

void Budget::warn_of_none(std::vector<Warning>& warnings) const {
  for (const auto& [of, fault] : none_) {
    warnings.push_back(
        {"no-drop",
         fmt::format("{}: {} % is {:.2f} drops a pixel, which rounds to none in {}; omit --no-dither, or request more",
                     key_of(of.first, *targets_, of.second), number_text(fault.requested), fault.drops, where(fault.where))});
  }
  for (const auto& [zone, jetted] : jetted_) {
    if (!jetted) warnings.push_back({"no-drop", "part.saturation_percent: 0: that part stays loose powder"});
  }
}

Status Budget::check(bool allow_unbound, std::vector<Warning>& warnings) const {
  if (!cut_.where.empty()) {
    warnings.push_back({"saturation", fmt::format("--saturation: {:.1f} % needs more than the {} drops a pixel that may be "
                                                  "jetted, {} get {:.1f} %; thinner layers or larger drops reach it",
                                                  cut_.requested, limit_, where(cut_.where), cut_.gets)});
  }
  if (!peaks_.where.empty()) {
    warnings.push_back(
        {"saturation", fmt::format("--saturation: the formula comes to {:.1f} % somewhere in the boxes of the parts, which "
                                   "needs more than the {} drops a pixel that may be jetted; pixels there get {:.1f} %, in {}",
                                   peaks_.requested, limit_, peaks_.gets, where(peaks_.where))});
  }
  warn_of_none(warnings);
  if (no_formula_) return *no_formula_;
  if (unbound_.where.empty() && !thin_.where.empty() && allow_unbound) {
    warnings.push_back(
        {"saturation", fmt::format("{} may get as little as {:.1f} % of their voids filled by their formula, and the "
                                   "powder binds from {} % on (powder.min_saturation_percent)",
                                   where(thin_.where), thin_.gets, number_text(min_percent_))});
  }
  const DoseFault& unbound = allow_unbound ? unbound_ : unbound_anywhere_;
  if (unbound.where.empty()) return {};
  const std::string requested = has_target() ? fmt::format(" where {} % is requested", number_text(unbound.requested)) : "";
  const std::string text = fmt::format(
      "{} get {}{:.1f} % of their voids filled{}, and the powder binds from {} % on "
      "(powder.min_saturation_percent)",
      where(unbound.where), unbound.alike ? "" : "as little as ", unbound.gets, requested, number_text(min_percent_));
  if (!allow_unbound) {
    return Error{Fault::kUsage, fmt::format("{}: {}; give {} saturation, or --allow-unbound",
                                            has_target() ? "--saturation" : "dose", text, has_target() ? "a higher" : "a")};
  }
  warnings.push_back({"saturation", fmt::format("{}, parts may crumble there", text)});
  return {};
}

void BinderCount::add(const Budget& budget, const Layer& layer, std::uint64_t dosed_pixels, std::uint64_t drops,
                      std::uint64_t requested_drops, std::uint64_t lost, std::uint32_t max_drops) {
  max_drops_ = std::max(max_drops_, max_drops);
  drops_ += drops - std::min(lost, drops);
  requested_drops_ += requested_drops;
  voids_pl_ += static_cast<double>(dosed_pixels) * dose::voids_pl(budget.binder(), budget.grid(), layer.thickness);
}

double BinderCount::percent(const Budget& budget, std::uint64_t drops) const {
  const double stays = budget.binder().drop_pl * (1 - budget.binder().evaporates);
  return voids_pl_ > 0 ? 100 * static_cast<double>(drops) * stays / voids_pl_ : 0;
}

}  // namespace lamina::dose
