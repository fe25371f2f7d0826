// stages/cost/cost.h: what a powder job uses up and costs, and what each of its parts has of that.
//
//      binder   (drops + spat drops x layers) x volume of a drop
//      fed      sum over layers: dose x thickness x area of the vats, that of the bed by default, as the powder cycle feeds
//      it; volumes of powder are those of
//               the bed, gaps between grains included
//      bound    sum over layers: set pixels x area of a pixel x thickness
//      left     fed - bound, 0 at least
//      spent    bound + left x (1 - reused share)
//      cost     binder x price + spent x price + hours x price, each rounded to hundredths
//
// A part's share: binder by its drops; hours and powder layer by layer, by its pixels of that layer that are to be filled, so
// that a part pays for the layers in which it stands. Layers without a pixel are shared by all pixels. Shares are whole drops,
// microseconds, nanolitres and hundredths by the largest remainder: those of the parts add up to the job exactly.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/machine.h"

namespace lamina::cost {

/// Divides a whole number in proportion to weights; the largest remainders get the units that are left, the first of equal
/// ones. Without any weight all are equal. weights  not empty; their sum below 2^63 As by Hamilton's method (Balinski and
/// Young, "Fair Representation", 1982).
std::vector<std::int64_t> shares(std::int64_t total, std::span<const std::uint64_t> weights);

/// What is used up; of a job, or of one of its parts.
struct Use {
  std::uint64_t pixels = 0, drops = 0;  // drops: those of spitting too
  std::int64_t microseconds = 0;
  std::int64_t binder_nl = 0;                                       // nanolitres: 1000 of them are 1 mm3
  std::int64_t fed_nl = 0, bound_nl = 0;                            // powder
  std::int64_t hour_cents = 0, binder_cents = 0, powder_cents = 0;  // hundredths of the currency
  std::int64_t left_nl() const { return fed_nl > bound_nl ? fed_nl - bound_nl : 0; }
  std::int64_t cents() const { return hour_cents + binder_cents + powder_cents; }
  bool operator==(const Use&) const = default;
};

struct Quote {
  Use job;
  std::vector<Use> parts;            // their sum is the job, field by field
  std::uint32_t unknown_layers = 0;  // have pixels, and do not say whose: shared as those without are
};

/// Adds up the layers of a job, in any order.
class Tally {
 public:
  /// machine  outlives this object. parts  of the job, at least 1
  Tally(const Machine& machine, const PixelGrid& grid, std::size_t parts);

  /// pixels  of the layer that are to be filled. part_pixels  of each part; empty: unknown, or of the only part
  /// part_drops  of each part; empty: as its pixels
  void add(std::int64_t thickness_nm, std::int64_t microseconds, std::uint64_t drops, std::uint64_t pixels,
           std::span<const std::uint64_t> part_pixels, std::span<const std::uint64_t> part_drops = {});

  /// The powder below the first layer, which all parts share.
  void add_base();

  Quote quote() const;

 private:
  struct PartTotals {
    std::uint64_t pixels = 0, drops = 0, pixel_nm = 0;
    std::int64_t microseconds = 0, fed_nl = 0;
  };
  const Machine& machine_;
  double pixel_mm2_, fed_mm2_;
  std::vector<PartTotals> parts_;
  std::uint64_t drops_ = 0, pixels_ = 0, pixel_nm_ = 0;
  std::int64_t microseconds_ = 0, fed_nl_ = 0;
  std::int64_t unshared_microseconds_ = 0, unshared_nl_ = 0;
  std::uint32_t unknown_layers_ = 0;
};

/// Price of a litre of powder as fed: powder_price_l, or powder_price_kg x powder_kg_l.
double powder_price_l(const Machine::Cost& cost);

/// Whether anything has a price.
bool has_prices(const Machine::Cost& cost);

}  // namespace lamina::cost
