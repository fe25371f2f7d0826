// stages/dose/budget.h: what binder a job asks for and gets, before it is made and after.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/dose/wish.h"

namespace lamina::dose {

/// Layers [first, last) that follow each other and have one thing in common.
struct LayerSpan {
  std::uint32_t first = 0, last = 0;
  std::int64_t from_nm = 0, to_nm = 0;  // heights above the bed
  double asked = 0, gets = 0;           // per cent, of the first of them
};

/// Looks at the layers of a job before any is made.
class Budget {
 public:
  /// wishes         none: one drop a pixel
  /// most_drops     that may be jetted on a pixel
  /// least_percent  of the voids, that binds; 0: nobody knows
  Budget(const Binder& binder, const PixelGrid& grid, std::optional<Wishes> wishes, std::uint32_t most_drops,
         double least_percent);

  /// Layers in their order. cost  that of dose_of(), once for equal layers
  void foresee(const Layer& layer);

  /// The most drops of any pixel in the layers so far.
  std::uint32_t most_drops() const { return most_drops_; }

  /// Warns of wishes that cannot be met. errors  kUsage: layers get less than binds, and that is not allowed
  Status judge(bool allow_unbound, std::vector<Warning>& warnings) const;

  const Binder& binder() const { return binder_; }
  const PixelGrid& grid() const { return grid_; }
  bool has_wish() const { return wishes_.has_value(); }
  /// Least and most per cent that the layers get.
  std::pair<double, double> gets() const { return gets_; }

 private:
  const LayerDose& dose(const Layer& layer, std::uint32_t zone);

  Binder binder_;
  PixelGrid grid_;
  std::optional<Wishes> wishes_;
  std::uint32_t limit_, most_drops_ = 0;
  double least_percent_;
  std::pair<double, double> gets_{0, 0};
  bool seen_ = false;
  std::map<std::pair<std::size_t, Nm>, LayerDose> known_;  // by place of the wish and thickness
  std::vector<LayerSpan> cut_, unbound_;
};

/// Counts what layers got.
class BinderCount {
 public:
  /// dosed_pixels, drops, asked_drops  of the layer's record; lost  drops that no nozzle fires
  void add(const Budget& budget, const Layer& layer, std::uint64_t dosed_pixels, std::uint64_t drops, std::uint64_t asked_drops,
           std::uint64_t lost);

  std::uint64_t drops() const { return drops_; }
  double binder_ml(const Budget& budget) const;
  /// Per cent of the voids of all dosed pixels, by the wish and by the drops.
  double asked_percent(const Budget& budget) const;
  double reached_percent(const Budget& budget) const;

 private:
  std::uint64_t drops_ = 0, asked_drops_ = 0;
  double voids_pl_ = 0;
};

/// The summary's line.
std::string told(const Budget& budget, const BinderCount& count);

}  // namespace lamina::dose
