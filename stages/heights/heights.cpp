#include "stages/heights/heights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <type_traits>

#include "stages/heights/greedy.h"

namespace lamina::heights {
namespace {

constexpr std::uint32_t kNone = UINT32_MAX;

// What a stack has cost so far. Where every flat is hit, only layers count: 32 bits, or 64 for microseconds. Where flats
// are missed, the upper half is the sum of their distances in nm and decides first.
using Layers = std::int32_t;
using Time = std::int64_t;
using MissesThenTime = __int128;

template <class Cost>
constexpr Cost unreached() {
  return static_cast<Cost>((static_cast<unsigned __int128>(1) << (8 * sizeof(Cost) - 1)) - 1);
}

// The highest candidate to which the steps allow a layer from each one. Both ends only move up: if a layer keeps the limit,
// one inside of it does.
Buffer<std::uint32_t> highest_by_cusp(const CandidateHeights& candidate_heights, const Buffer<Steepness>& cells,
                                      std::int64_t cusp, std::int64_t maximum) {
  Buffer<std::uint32_t> highest(candidate_heights.candidates());
  Buffer<std::uint32_t> window(
      candidate_heights.cells());  // cells of decreasing steepness, the first is the steepest in the window
  std::uint32_t front = 0, back = 0, end = 0;
  for (std::uint32_t candidate = 0; candidate < candidate_heights.candidates(); ++candidate) {
    const std::int64_t bottom = candidate_heights[candidate];
    end = std::max(end, candidate);
    while (front < back && window[front] < candidate) ++front;
    while (end + 1 < candidate_heights.candidates()) {
      const std::int64_t thickness = candidate_heights[end + 1] - bottom;
      const Steepness flattest = std::max(cells[end], front < back ? cells[window[front]] : 0);
      if (thickness > maximum || cusp_of(thickness, flattest) > cusp) break;
      while (front < back && cells[window[back - 1]] <= cells[end]) --back;
      window[back++] = end++;
    }
    highest[candidate] = end;
  }
  return highest;
}

/// Stacks on evenly spaced candidates. From candidate r a layer may end on any one from r + minimum to limit[r].
struct Stacks {
  std::span<const std::int32_t> layers;  // the fewest of any stack that ends there; above that of `end`: none does
  std::span<const std::uint32_t> limit;  // by candidate; r or less where no layer starts, else it only grows
  std::span<const double> below;         // mm2 of slopes below each candidate; only grows
  std::uint32_t minimum;                 // candidates
  std::uint32_t end;                     // the candidate on which the stack ends
};

constexpr double kFar = std::numeric_limits<double>::infinity();

/// For each candidate on which some stack of the fewest layers to the end has a boundary, the next boundary of the one whose
/// thickness times slopes, summed over its layers, is minimal from there on; other entries are UINT32_MAX.
///
/// Thickness times slopes is a product of two measures of the same interval, so that wide layer plus narrow layer within
/// it cost no less than the two that cross. Hence the best next boundary only moves up with the candidate (F. F. Yao,
/// "Efficient dynamic programming using quadrangle inequalities", 1980), and halving finds all of them.
///
/// cost  O(candidates * log(candidates of the same number of layers))
class HeightSearch {
 public:
  explicit HeightSearch(const Stacks& stacks) : stacks_(stacks), steps_(stacks.end + 1, kFar), via_(stacks.end + 1, kNone) {}

  Buffer<std::uint32_t> all() {
    sort_by_layers();
    steps_[stacks_.end] = 0;
    columns_ = {stacks_.end};
    for (std::int32_t layers = stacks_.layers[stacks_.end]; layers-- > 0;) {
      find_rows(layers);
      if (!rows_.empty()) halve(0, rows_.size(), 0, columns_.size() - 1);
      columns_.clear();
      for (const CandidateRow& row : rows_) columns_.push_back(row.candidate);
    }
    return std::move(via_);
  }

 private:
  // A candidate and the columns, [first, last), on which a layer from it may end.
  struct CandidateRow {
    std::uint32_t candidate;
    std::size_t first, last;
  };

  void sort_by_layers() {
    const std::int32_t maximum = stacks_.layers[stacks_.end];
    begin_.assign(maximum + 2, 0);
    const auto counts = [&](std::uint32_t candidate) { return stacks_.layers[candidate] < maximum; };
    for (std::uint32_t candidate = 0; candidate < stacks_.end; ++candidate) {
      if (counts(candidate)) ++begin_[stacks_.layers[candidate] + 1];
    }
    for (std::int32_t layers = 0; layers < maximum; ++layers) begin_[layers + 1] += begin_[layers];
    candidates_.resize(begin_[maximum]);
    Buffer<std::uint32_t> next = begin_;
    for (std::uint32_t candidate = 0; candidate < stacks_.end; ++candidate) {
      if (counts(candidate)) candidates_[next[stacks_.layers[candidate]]++] = candidate;
    }
  }

  // The candidates from which a layer reaches a column. Both ends of what they reach only move up.
  void find_rows(std::int32_t layers) {
    rows_.clear();
    std::size_t first = 0, last = 0;
    for (std::uint32_t i = begin_[layers]; i < begin_[layers + 1]; ++i) {
      const std::uint32_t candidate = candidates_[i], limit = stacks_.limit[candidate];
      if (limit < candidate + stacks_.minimum) continue;
      while (first < columns_.size() && columns_[first] < candidate + stacks_.minimum) ++first;
      while (last < columns_.size() && columns_[last] <= limit) ++last;
      if (first < last) rows_.push_back({candidate, first, last});
    }
  }

  // Rows [first, last), whose best columns lie in [low, high].
  void halve(std::size_t first, std::size_t last, std::size_t low, std::size_t high) {
    const std::size_t middle = first + (last - first) / 2;
    const CandidateRow& row = rows_[middle];
    const double below = stacks_.below[row.candidate];
    std::size_t best = low;
    double minimum = kFar;
    for (std::size_t i = std::max(row.first, low); i <= std::min(row.last - 1, high); ++i) {
      const std::uint32_t up = columns_[i];
      const double value = steps_[up] + (up - row.candidate) * (stacks_.below[up] - below);
      if (value > minimum) continue;  // of equal ones the thickest
      minimum = value;
      best = i;
    }
    steps_[row.candidate] = minimum;
    via_[row.candidate] = columns_[best];
    if (first < middle) halve(first, middle, low, best);
    if (middle + 1 < last) halve(middle + 1, last, best, high);
  }

  const Stacks& stacks_;
  Buffer<double> steps_;  // mm2 times steps, from a candidate to the end
  Buffer<std::uint32_t> via_;
  Buffer<std::uint32_t> candidates_, begin_;  // by number of layers below them, with the offset of each number
  Buffer<std::uint32_t> columns_;             // those of one layer more from which the end is reached
  Buffer<CandidateRow> rows_;
};

/// The best of all layer tables: of all stacks of the set's thicknesses in which no slope gets a step above options.cusp,
/// except in layers of the minimum thickness, the one with
///   1. the minimum distance from the flat that is missed most,
///   2. the minimum sum of the distances of all flats that are missed,
///   3. the fewest layers, or the minimum time,
///   4. the end that is nearest to the top, the lower one of two,
///   5. the minimum mean step, weighted by area.
/// A flat is missed by its distance from the nearest boundary if that is more than options.surface.flat_tolerance or
/// half the step that all thicknesses share, whichever is less: a flat that the thicknesses can meet is met. The top of
/// the parts counts as a flat, and the stack ends there; with options.flats off there are no flats, and the stack ends
/// at or above the top.
///
/// Every height that the thicknesses reach is a state; the cost of reaching it is known when all lower ones are (dynamic
/// programming, R. Bellman 1957; for layers, each state is one height). Because the layers allowed from a state are the
/// thinnest ones up to some limit, a state is expanded without reading the surface again.
///
/// cost  O(states * log thicknesses) where the thicknesses are all of a range and its flats can be hit, else
///       O(states * thicknesses)
class Solver {
 public:
  Solver(const SurfaceIndex& index, const Options& options, const CandidateHeights& candidate_heights)
      : index_(index),
        options_(options),
        candidate_heights_(candidate_heights),
        set_(options.set),
        tolerance_(options.surface.flat_tolerance) {
    // Where every height is within the tolerance of a candidate, the nearest candidate has to be met.
    hit_ = candidate_heights.step() > 0 ? std::min<std::int64_t>(tolerance_, candidate_heights.step() / 2) : tolerance_;
    highest_ = highest_by_cusp(candidate_heights, steepest_in_cells(index, index.parts, candidate_heights), options.cusp,
                               set_.maximum());
    if (options.flats) {
      for (const Flat& flat : find_flats(index, tolerance_, options.min_flat_mm2)) {
        if (flat.height < index.top) flats_.push_back(flat.height);
      }
    }
    if (candidate_heights.step() > 0) {
      for (const Nm value : set_.values) strides_.push_back(static_cast<std::uint32_t>(value / candidate_heights.step()));
    }
    weigh_layers();
  }

  Plan solve() {
    Plan plan;
    allow(hit_);
    std::vector<std::uint32_t> thicknesses = weights_.empty() ? solve<Layers>() : solve<Time>();
    if (thicknesses.empty()) {
      plan.largest_miss = smallest_largest_miss();
      allow(plan.largest_miss);
      thicknesses = solve<MissesThenTime>();
    }
    std::int64_t bottom = 0;
    for (const std::uint32_t i : thicknesses) {
      plan.table.add(set_.values[i], reason(bottom, i));
      bottom += set_.values[i];
    }
    plan.one_less_reaches = one_less_;
    return plan;
  }

 private:
  // Costs of layers by the candidate at their bottom, in microseconds; empty if each counts 1.
  void weigh_layers() {
    if (!options_.time.on()) return;
    const Buffer<double> section = section_at_candidates(index_, candidate_heights_, tolerance_);
    weights_.resize(candidate_heights_.candidates());
    for (std::uint32_t candidate = 0; candidate < candidate_heights_.candidates(); ++candidate) {
      weights_[candidate] = std::max<std::int64_t>(1, std::llround(options_.time.seconds(section[candidate]) * 1e6));
    }
  }

  bool is_end(std::uint32_t candidate) const {
    const std::int64_t height = candidate_heights_[candidate];
    if (candidate == 0) return false;
    return options_.flats ? covers(height) && std::abs(height - index_.top) <= allowed_ : height >= index_.top;
  }
  bool covers(std::int64_t height) const { return !options_.cover_top || height >= index_.top - hit_; }
  std::int64_t counted(std::int64_t distance) const { return distance > hit_ ? distance : 0; }

  // Calls visit(thickness index, upper candidate) for every thickness from a candidate, thin to thick.
  template <class Visit>
  void for_each_layer(std::uint32_t candidate, const Visit& visit) const {
    for (std::uint32_t i = 0; i < set_.size(); ++i) {
      const std::uint32_t up = strides_.empty()
                                   ? candidate_heights_.candidates_up_to(candidate_heights_[candidate] + set_.values[i]) - 1
                                   : candidate + strides_[i];
      if (up > limit_[candidate]) return;
      visit(i, up);
    }
  }
  // The highest candidate that a layer from each candidate may reach if every flat has to have a boundary within `distance`.
  void allow(std::int64_t distance) {
    allowed_ = distance;
    limit_.resize(candidate_heights_.candidates());
    const std::int64_t ceiling = options_.flats ? index_.top + distance : INT64_MAX;
    std::size_t flat = 0;
    for (std::uint32_t candidate = 0; candidate < candidate_heights_.candidates(); ++candidate) {
      const std::int64_t bottom = candidate_heights_[candidate];
      while (flat < flats_.size() && flats_[flat] - distance <= bottom) ++flat;
      std::int64_t maximum = std::min(ceiling, bottom + set_.maximum());
      if (flat < flats_.size()) maximum = std::min(maximum, flats_[flat] + distance);
      if (options_.slab > 0) {
        // A boundary so near to the top that no layer fits between them would leave the top missed.
        const std::int64_t boundary = (bottom / options_.slab + 1) * options_.slab;
        if (boundary >= index_.top || index_.top - boundary >= set_.minimum()) maximum = std::min(maximum, boundary);
      }
      // The minimum thickness is allowed regardless of the slopes.
      const std::uint32_t thinnest = candidate_heights_.candidates_up_to(bottom + set_.minimum()) - 1;
      limit_[candidate] = std::min(candidate_heights_.candidates_up_to(maximum) - 1, std::max(highest_[candidate], thinnest));
      if (bottom + set_.minimum() > maximum) limit_[candidate] = candidate;
    }
  }

  // The cost of a layer. first_flat: the first one above its bottom.
  template <class Cost>
  Cost weight(std::uint32_t candidate, std::size_t first_flat, std::uint32_t up) const {
    Cost cost = weights_.empty() ? Cost{1} : static_cast<Cost>(weights_[candidate]);
    if constexpr (sizeof(Cost) > 8) {
      for_each_miss(first_flat, candidate_heights_[candidate], candidate_heights_[up],
                    [&](std::int64_t miss) { cost += Cost{miss} << 64; });
    }
    return cost;
  }
  template <class Cost>
  Cost end_cost(std::uint32_t candidate) const {
    std::int64_t missed = counted(std::abs(candidate_heights_[candidate] - index_.top));
    for (std::size_t i = first_flat_above(candidate_heights_[candidate]); i < flats_.size(); ++i)
      missed += counted(flats_[i] - candidate_heights_[candidate]);
    return static_cast<Cost>(static_cast<__int128>(missed) << 64);
  }
  // Nothing is built upon an end, but where ends are missed the next candidate may be nearer.
  template <class Cost>
  bool is_last(std::uint32_t candidate) const {
    return sizeof(Cost) > 8 ? candidate_heights_[candidate] >= index_.top : is_end(candidate);
  }

  // The costs of reaching every candidate that layers within limit_ reach.
  template <class Cost>
  Buffer<Cost> costs_by_layers() const {
    Buffer<Cost> cost(candidate_heights_.candidates(), unreached<Cost>());
    cost[0] = 0;
    for (std::uint32_t candidate = 0; candidate < candidate_heights_.candidates(); ++candidate) {
      if (cost[candidate] == unreached<Cost>() || is_last<Cost>(candidate)) continue;
      const std::size_t flat = first_flat_above(candidate_heights_[candidate]);
      for_each_layer(candidate, [&](std::uint32_t, std::uint32_t up) {
        cost[up] = std::min(cost[up], cost[candidate] + weight<Cost>(candidate, flat, up));
      });
    }
    return cost;
  }
  // The same where the thicknesses are all the multiples of the step in a range and a layer's cost does not depend on its
  // top: the candidates below from which one can be reached are a window whose ends only move up, so that finding the
  // cheapest costs O(1) a candidate.
  template <class Cost>
  Buffer<Cost> costs_by_windows() const {
    Buffer<Cost> cost(candidate_heights_.candidates(), unreached<Cost>());
    cost[0] = 0;
    // Of increasing cost of what is built on them, the first is the cheapest.
    Buffer<std::uint32_t> window(candidate_heights_.candidates());
    Buffer<Cost> built(candidate_heights_.candidates());
    std::uint32_t front = 0, back = 0;
    for (std::uint32_t up = strides_.front(); up < candidate_heights_.candidates(); ++up) {
      const std::uint32_t candidate = up - strides_.front();
      if (cost[candidate] != unreached<Cost>() && limit_[candidate] > candidate && !is_last<Cost>(candidate)) {
        built[candidate] = cost[candidate] + weight<Cost>(candidate, 0, 0);
        while (front < back && built[window[back - 1]] >= built[candidate]) --back;
        window[back++] = candidate;
      }
      while (front < back && limit_[window[front]] < up) ++front;
      if (front < back) cost[up] = built[window[front]];
    }
    return cost;
  }

  // The best stack, as indices of thicknesses, bottom up; empty if none keeps limit_.
  template <class Cost>
  std::vector<std::uint32_t> solve() {
    const Buffer<Cost> cost = sizeof(Cost) <= 8 && even_range() ? costs_by_windows<Cost>() : costs_by_layers<Cost>();
    std::uint32_t end = kNone;
    Cost best = unreached<Cost>();
    for (std::uint32_t candidate = 0; candidate < candidate_heights_.candidates(); ++candidate) {
      if (cost[candidate] == unreached<Cost>() || !is_end(candidate)) continue;
      const Cost whole = cost[candidate] + (sizeof(Cost) > 8 ? end_cost<Cost>(candidate) : Cost{0});
      if (whole < best || (whole == best && nearer_top(candidate, end))) {
        end = candidate;
        best = whole;
      }
    }
    if (end == kNone) return {};
    for (std::uint32_t candidate = 0; candidate < candidate_heights_.candidates(); ++candidate) {
      if (cost[candidate] < best && !is_end(candidate)) one_less_ = candidate_heights_[candidate];
    }
    return trace(cost, end);
  }
  // Whether the thicknesses are all the multiples of the candidates' step in a range.
  bool even_range() const { return !strides_.empty() && set_.is_contiguous() && set_.step() == candidate_heights_.step(); }

  bool nearer_top(std::uint32_t a, std::uint32_t b) const {
    return std::abs(candidate_heights_[a] - index_.top) < std::abs(candidate_heights_[b] - index_.top);
  }

  // Calls visit(miss) for each flat strictly between two heights that is missed.
  template <class Visit>
  void for_each_miss(std::size_t first_flat, std::int64_t bottom, std::int64_t top, const Visit& visit) const {
    for (std::size_t i = first_flat; i < flats_.size() && flats_[i] < top; ++i) {
      const std::int64_t miss = counted(std::min(flats_[i] - bottom, top - flats_[i]));
      if (miss > 0) visit(miss);
    }
  }
  std::size_t first_flat_above(std::int64_t height) const {
    return static_cast<std::size_t>(std::ranges::upper_bound(flats_, height) - flats_.begin());
  }

  // The least that the largest miss of any stack can be.
  std::int64_t smallest_largest_miss() {
    allow(index_.top + set_.maximum());
    Buffer<std::int64_t> worst(candidate_heights_.candidates(), unreached<std::int64_t>());
    worst[0] = 0;
    std::int64_t best = unreached<std::int64_t>();
    for (std::uint32_t candidate = 0; candidate < candidate_heights_.candidates(); ++candidate) {
      if (worst[candidate] == unreached<std::int64_t>()) continue;
      const std::int64_t bottom = candidate_heights_[candidate];
      if (candidate > 0 && covers(bottom))
        best = std::min(best, std::max(worst[candidate], counted(std::abs(bottom - index_.top))));
      if (bottom >= index_.top) continue;
      const std::size_t flat = first_flat_above(bottom);
      for_each_layer(candidate, [&](std::uint32_t, std::uint32_t up) {
        std::int64_t value = worst[candidate];
        for_each_miss(flat, bottom, candidate_heights_[up], [&](std::int64_t miss) { value = std::max(value, miss); });
        worst[up] = std::min(worst[up], value);
      });
    }
    return best;
  }

  // Of all stacks that reach `end` at its cost, the one with the least mean cusp.
  template <class Cost>
  std::vector<std::uint32_t> trace(const Buffer<Cost>& cost, std::uint32_t end) const {
    const Buffer<double> below = projected_below(index_, index_.parts, candidate_heights_, Sign::kBoth);
    Buffer<std::uint32_t> via;  // the next candidate of the stack from each one
    if constexpr (std::is_same_v<Cost, Layers>) {
      if (even_range()) via = HeightSearch({cost, limit_, below, strides_.front(), end}).all();
    }
    if (via.empty()) via = fewest_steps_by_layers(cost, below, end);
    std::vector<std::uint32_t> thicknesses;
    for (std::uint32_t candidate = 0; candidate != end; candidate = via[candidate]) {
      const auto value =
          std::ranges::lower_bound(set_.values, candidate_heights_[via[candidate]] - candidate_heights_[candidate]);
      thicknesses.push_back(static_cast<std::uint32_t>(value - set_.values.begin()));
    }
    return thicknesses;
  }
  template <class Cost>
  Buffer<std::uint32_t> fewest_steps_by_layers(const Buffer<Cost>& cost, const Buffer<double>& below, std::uint32_t end) const {
    Buffer<double> steps(end + 1, kFar);  // mm2 nm, from a candidate to the end
    Buffer<std::uint32_t> via(end + 1, kNone);
    steps[end] = 0;
    for (std::uint32_t candidate = end; candidate-- > 0;) {
      if (cost[candidate] == unreached<Cost>() || is_last<Cost>(candidate)) continue;
      const std::size_t flat = sizeof(Cost) > 8 ? first_flat_above(candidate_heights_[candidate]) : 0;
      for_each_layer(candidate, [&](std::uint32_t i, std::uint32_t up) {
        if (up > end || steps[up] == kFar || cost[candidate] + weight<Cost>(candidate, flat, up) != cost[up]) return;
        const double value = steps[up] + set_.values[i] * (below[up] - below[candidate]);
        if (value > steps[candidate]) return;  // of equal ones the thickest
        steps[candidate] = value;
        via[candidate] = up;
      });
    }
    return via;
  }

  LayerReason reason(std::int64_t bottom, std::uint32_t i) const {
    const std::int64_t top = bottom + set_.values[i];
    if (i + 1 == set_.size()) return LayerReason::kUniform;
    if (options_.flats) {
      if (std::abs(top - index_.top) <= tolerance_) return LayerReason::kFlat;
      const auto flat = std::ranges::lower_bound(flats_, top - tolerance_);
      if (flat != flats_.end() && *flat <= top + tolerance_) return LayerReason::kFlat;
    }
    const bool limited =
        candidate_heights_[highest_[candidate_heights_.candidates_up_to(bottom) - 1]] < bottom + set_.values[i + 1];
    return limited || !options_.flats ? LayerReason::kCusp : LayerReason::kFlat;
  }

  const SurfaceIndex& index_;
  const Options& options_;
  const CandidateHeights& candidate_heights_;
  const ThicknessSet& set_;
  const Nm tolerance_;
  std::vector<std::int64_t> flats_;     // below the top
  std::vector<std::uint32_t> strides_;  // thicknesses in steps of candidates, where these are even
  Buffer<std::uint32_t> highest_, limit_;
  Buffer<std::int64_t> weights_;
  std::int64_t hit_ = 0, allowed_ = 0, one_less_ = -1;
};

}  // namespace

Result<std::string> check_build_steps(const Machine& machine, const LayerTable& table) {
  const std::int64_t step = std::max<std::int64_t>(1, std::llround(machine.motion.layer_step_um * 1000));
  std::uint32_t off = 0, first = 0;
  std::int64_t maximum = 0;
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    const Layer layer = table[i];
    if (layer.thickness < step) {
      return Error{Fault::kUsage, fmt::format("layer {}: {:g} mm is less than a step of {}, {:g} mm; use thicker layers", i,
                                              mm(layer.thickness), machine.name, mm(step))};
    }
    const std::int64_t over = (std::int64_t{layer.bottom} + layer.thickness) % step;
    if (over == 0) continue;
    if (off++ == 0) first = i;
    maximum = std::max(maximum, std::min(over, step - over));
  }
  if (off == 0) return std::string();
  return fmt::format(
      "{} of {} layers, first {}, end between the {:g} mm steps of {}'s build vat, off by up to {:g} mm, which the "
      "machine cannot reach; use thicknesses of whole steps",
      off, table.size(), first, mm(step), machine.name, mm(maximum));
}

Result<Options> options_of(const Settings& settings, double layer_mm) {
  Options options;
  options.mode = settings.mode;
  options.cusp = static_cast<Nm>(nm_of(settings.cusp_mm));
  options.adapt_angle_deg = settings.adapt_angle_deg;
  options.surface.peak_angle_deg = settings.peak_angle_deg;
  options.surface.normal_tolerance = settings.normal_tolerance;
  options.surface.flat_tolerance = static_cast<Nm>(nm_of(settings.flat_tolerance_um / 1000));
  options.surface.min_facet_mm2 = settings.min_facet_mm2;
  options.surface.nominal_cusps = settings.cusp_of == CuspOf::kNominal;
  options.peaks = settings.peaks;
  options.cover_top = settings.cover_top;
  options.facets = settings.facets;
  options.flats = settings.flats;
  options.min_flat_mm2 = settings.min_flat_mm2;
  options.time = {settings.time_model[0], settings.time_model[1]};
  if (!settings.thickness_mm.empty()) {
    Result<ThicknessSet> set = read_thicknesses(settings.thickness_mm);
    if (!set) return Error{Fault::kUsage, "heights.thickness_mm: " + set.error().message};
    options.set = std::move(*set);
  } else if (settings.mode == Mode::kUniform) {
    options.set.values = {static_cast<Nm>(nm_of(layer_mm))};
  } else {
    return Error{Fault::kUsage, fmt::format("--heights {}: needs thicknesses to choose from; add --thickness with a set as "
                                            "0.178,0.254 or a range as 0.05..0.3",
                                            mode_name(settings.mode))};
  }
  if (Status status = check_options(options); !status) return status.error();
  return options;
}

Status check_options(const Options& options) {
  const auto wrong = [](std::string text) { return Error{Fault::kUsage, std::move(text)}; };
  if (options.set.values.empty()) {
    return wrong("heights.thickness: contains no thickness; give a set as 0.178,0.254 or a range as 0.05..0.30:0.01");
  }
  Nm before = 0;
  for (const Nm value : options.set.values) {
    if (value <= before) return wrong("heights.thickness: thicknesses have to be above 0 and to differ");
    before = value;
  }
  if (options.mode == Mode::kUniform && options.set.size() > 1) {
    return wrong(
        fmt::format("heights.thickness: uniform layers have one thickness, here are {}; give one, or another "
                    "--heights",
                    options.set.size()));
  }
  const bool by_cusp = options.mode == Mode::kCusp || options.mode == Mode::kStepwise || options.mode == Mode::kOptimal;
  if (by_cusp && options.cusp <= 0) {
    return wrong("heights.cusp_mm: 0 is a limit that no slope can keep; give a height above 0, as 0.1");
  }
  return {};
}

Result<Plan> plan_heights(const SurfaceIndex& index, const Options& options) {
  if (Status status = check_options(options); !status) return status.error();
  if (options.mode == Mode::kUniform) {
    Plan plan;
    plan.table = LayerTable::uniform(index.top, options.set.minimum());
    return plan;
  }
  Result<CandidateHeights> candidate_heights =
      CandidateHeights::reachable(options.set, std::int64_t{index.top} + options.set.maximum());
  if (!candidate_heights) return candidate_heights.error();
  if (options.mode == Mode::kOptimal) return Solver(index, options, *candidate_heights).solve();
  Plan plan;
  GreedyLayers layers(index, options, std::move(*candidate_heights), plan);
  while (layers.advance(plan)) {
  }
  return plan;
}

std::int64_t slab_height(const ThicknessSet& set) {
  const std::int64_t minimum = set.minimum(), maximum = set.maximum();
  return set.is_contiguous() ? ceil_div(maximum, minimum) * minimum : std::lcm(minimum, maximum);
}

Status check_slab(const ThicknessSet& set) {
  constexpr std::int64_t kMaxSlab = 16;  // times the greatest thickness: above, parts have hardly a boundary in common
  const std::int64_t slab = slab_height(set);
  if (slab <= kMaxSlab * set.maximum()) return {};
  return Error{Fault::kUsage,
               fmt::format("heights.per_part: {} and {} mm meet only every {} mm; give thicknesses with a smaller "
                           "common multiple, or a range",
                           mm(set.minimum()), mm(set.maximum()), mm(slab))};
}

Result<PerPartPlan> plan_per_part(SurfaceIndex index, const Options& options) {
  if (Status status = check_slab(options.set); !status) return status.error();
  PerPartPlan result;
  result.slab = slab_height(options.set);
  Options own = options;
  own.mode = Mode::kOptimal;
  own.slab = result.slab;
  const std::vector<PartSurface> parts = std::exchange(index.parts, {});
  for (const PartSurface& part : parts) {
    index.parts = {part};
    index.top = part.top;
    Result<Plan> plan = plan_heights(index, own);
    if (!plan) return plan.error();
    result.parts.push_back(std::move(*plan));
  }
  return result;
}

Status OnRecord::check(const Layer& layer) {
  const bool uniform = options_ && options_->mode == Mode::kUniform;
  if (layer.index == 0) begins_ = 0;
  if (uniform) begins_ = std::int64_t{layer.index} * options_->set.minimum();
  const auto begins = std::exchange(begins_, std::int64_t{layer.bottom} + layer.thickness);
  const Status thick = options_ ? check_thickness(layer) : Status();
  if (begins && layer.bottom != *begins) {
    return Error{Fault::kVerification,
                 fmt::format("layer {}: begins {} nm above the bed, the manifest says {}", layer.index, *begins, layer.bottom)};
  }
  return thick;
}

Status OnRecord::check_thickness(const Layer& layer) {
  const ThicknessSet& set = options_->set;
  const auto wrong = [&](const std::string& what) {
    return Error{Fault::kVerification, fmt::format("layer {}: {}", layer.index, what)};
  };
  if (options_->mode == Mode::kStepwise) {
    if (divides_slab(layer)) return {};
    return wrong(fmt::format("divides no slab of {} nm evenly, from {} to {} nm", set.maximum(), layer.bottom,
                             std::int64_t{layer.bottom} + layer.thickness));
  }
  if (std::ranges::binary_search(set.values, layer.thickness)) return {};
  if (options_->mode == Mode::kUniform) {
    return wrong(fmt::format("is {} nm thick as all of the job, the manifest says {}", set.minimum(), layer.thickness));
  }
  return wrong(fmt::format("is {} nm thick, by the manifest, which is not a thickness of the job", layer.thickness));
}

bool OnRecord::divides_slab(const Layer& layer) {
  const std::int64_t slab = options_->set.maximum(), low = layer.bottom % slab, high = low + layer.thickness;
  if (low == 0) {
    count_ = 0;
    fewest_ = 1;
    max_ = slab / options_->set.minimum();
  }
  if (count_ < 0) return high <= slab;
  // Boundary i of n divisions lies at floor(slab * i / n).
  const auto meet = [&](std::int64_t i, std::int64_t position) {
    fewest_ = std::max(fewest_, slab * i / (position + 1) + 1);
    if (position > 0) max_ = std::min(max_, slab * i / position);
  };
  meet(count_, low);
  meet(++count_, high);
  if (high <= slab && fewest_ <= max_) return true;
  count_ = -1;
  return false;
}

}  // namespace lamina::heights
