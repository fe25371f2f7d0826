#include "stages/cost/cost.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lamina::cost {
namespace {

constexpr double kNlPerLitre = 1e9, kMicrosecondsPerHour = 3.6e9;
constexpr double kMax = 9e17;  // of amounts in units; sums of a job stay within int64

std::int64_t whole(double amount) { return std::llround(std::clamp(amount, 0.0, kMax)); }

}  // namespace

std::vector<std::int64_t> shares(std::int64_t total, std::span<const std::uint64_t> weights) {
  const bool none = std::ranges::all_of(weights, [](std::uint64_t weight) { return weight == 0; });
  const auto weight = [&](std::size_t i) { return static_cast<unsigned __int128>(none ? 1 : weights[i]); };
  unsigned __int128 sum = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) sum += weight(i);
  std::vector<std::int64_t> share(weights.size());
  std::vector<std::uint64_t> rest(weights.size());
  std::int64_t left = total;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const unsigned __int128 product = static_cast<unsigned __int128>(total) * weight(i);
    share[i] = static_cast<std::int64_t>(product / sum);
    rest[i] = static_cast<std::uint64_t>(product % sum);
    left -= share[i];
  }
  std::vector<std::size_t> order(weights.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, std::ranges::greater(), [&](std::size_t i) { return rest[i]; });
  for (std::size_t i = 0; left > 0; ++i, --left) ++share[order[i]];
  return share;
}

double powder_price_l(const Machine::Cost& cost) {
  return cost.powder_price_l > 0 ? cost.powder_price_l : cost.powder_price_kg * cost.powder_kg_l;
}

bool has_prices(const Machine::Cost& cost) {
  return cost.hour_price > 0 || cost.binder_price_l > 0 || powder_price_l(cost) > 0;
}

Tally::Tally(const Machine& machine, const PixelGrid& grid, std::size_t parts)
    : machine_(machine),
      pixel_mm2_(25.4 * 25.4 / (grid.x.dpi() * grid.y.dpi())),
      fed_mm2_(fed_area_mm2(machine)),
      parts_(parts) {}

void Tally::add(std::int64_t thickness_nm, std::int64_t microseconds, std::uint64_t drops, std::uint64_t pixels,
                std::span<const std::uint64_t> part_pixels, std::span<const std::uint64_t> part_drops) {
  const std::int64_t fed_nl = whole(machine_.powder.dose * static_cast<double>(thickness_nm) * 1e-3 * fed_mm2_);
  const std::uint64_t of_layer = pixels * static_cast<std::uint64_t>(thickness_nm);
  drops_ += drops + machine_.cost.spit_drops;
  pixels_ += pixels;
  pixel_nm_ += of_layer;
  microseconds_ += microseconds;
  fed_nl_ += fed_nl;
  const std::uint64_t only[] = {pixels};
  if (parts_.size() == 1) part_pixels = only;
  if (pixels == 0 || part_pixels.size() != parts_.size()) {
    unshared_microseconds_ += microseconds;
    unshared_nl_ += fed_nl;
    unknown_layers_ += pixels > 0;
    return;
  }
  if (part_drops.size() != parts_.size()) part_drops = part_pixels;
  const auto time = shares(microseconds, part_pixels), fed = shares(fed_nl, part_pixels);
  const auto fired = shares(static_cast<std::int64_t>(drops), part_drops);
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    parts_[p].pixels += part_pixels[p];
    parts_[p].drops += static_cast<std::uint64_t>(fired[p]);
    parts_[p].pixel_nm += part_pixels[p] * static_cast<std::uint64_t>(thickness_nm);
    parts_[p].microseconds += time[p];
    parts_[p].fed_nl += fed[p];
  }
}

void Tally::add_base() {
  const std::int64_t fed_nl = whole(machine_.powder.dose * machine_.powder.base_mm() * 1e3 * fed_mm2_);
  fed_nl_ += fed_nl;
  unshared_nl_ += fed_nl;
}

Quote Tally::quote() const {
  const Machine::Cost& cost = machine_.cost;
  Use job{pixels_, drops_, microseconds_};
  job.binder_nl = whole(static_cast<double>(drops_) * machine_.head.drop_pl * 1e-3);
  job.fed_nl = fed_nl_;
  job.bound_nl = whole(static_cast<double>(pixel_nm_) * 1e-3 * pixel_mm2_);
  const double spent_nl = static_cast<double>(job.bound_nl) + static_cast<double>(job.left_nl()) * (1 - cost.powder_reuse);
  job.hour_cents = whole(100 * cost.hour_price * static_cast<double>(microseconds_) / kMicrosecondsPerHour);
  job.binder_cents = whole(100 * cost.binder_price_l * static_cast<double>(job.binder_nl) / kNlPerLitre);
  job.powder_cents = whole(100 * powder_price_l(cost) * spent_nl / kNlPerLitre);

  std::vector<std::uint64_t> pixels, drops, pixel_nm, time, fed;
  for (const PartTotals& part : parts_)
    pixels.push_back(part.pixels), drops.push_back(part.drops), pixel_nm.push_back(part.pixel_nm);
  const auto further_time = shares(unshared_microseconds_, pixels), further_fed = shares(unshared_nl_, pixels);
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    time.push_back(static_cast<std::uint64_t>(parts_[p].microseconds + further_time[p]));
    fed.push_back(static_cast<std::uint64_t>(parts_[p].fed_nl + further_fed[p]));
  }
  const auto all_pixels = shares(static_cast<std::int64_t>(pixels_), pixels), binder = shares(job.binder_nl, drops);
  const auto all_drops = shares(static_cast<std::int64_t>(drops_), drops);
  const auto bound = shares(job.bound_nl, pixel_nm), hour_cents = shares(job.hour_cents, time);
  const auto binder_cents = shares(job.binder_cents, drops), powder_cents = shares(job.powder_cents, fed);
  Quote quote{job, {}, unknown_layers_};
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    quote.parts.push_back({static_cast<std::uint64_t>(all_pixels[p]), static_cast<std::uint64_t>(all_drops[p]),
                           static_cast<std::int64_t>(time[p]), binder[p], static_cast<std::int64_t>(fed[p]), bound[p],
                           hour_cents[p], binder_cents[p], powder_cents[p]});
  }
  return quote;
}

}  // namespace lamina::cost
