// stages/data/machine.h: a powder printer as its profile describes it. Plain values, units in the names.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace lamina {

enum class BedShape : std::uint8_t { kRectangle, kRound };
enum class ScanAxis : std::uint8_t { kX, kY };
/// A side of the bed in plan view: x grows to the right, y to the back.
enum class Side : std::uint8_t { kLeft, kRight, kFront, kBack };
/// What becomes of the pixels of a nozzle that does not fire.
enum class BlockedRule : std::uint8_t {
  kReport,     // they are left out and counted
  kNeighbour,  // they go to the same column of the next nozzle on either side, where that pixel is free
  kSecondPass  // a further sweep, shifted by whole nozzles, fires them: the layer stays exact
};
/// Where a nozzle's firing is aimed at along the scan.
enum class LagUnit : std::uint8_t { kPixel, kTick };
/// Where the first swath of a layer begins.
enum class FirstSwath : std::uint8_t { kBed, kLayer };
/// Which vat feeds a layer that holds both materials; kRefuse, the default: there must be none.
enum class VatRule : std::uint8_t { kFirst, kSecond, kMajority, kBoth, kRefuse };
/// What becomes of a job that takes more powder than a vat of stated depth holds.
enum class VatRefill : std::uint8_t {
  kRefuse,  // it is refused before it starts
  kPause    // the program pauses before the layers for which vats have to be filled
};

/// Everything that a profile says. Checked by program::make_head_grid.
struct Machine {
  std::string name, description;
  std::string dialect = "nuferbj";
  std::string firmware;  // its version, such as 2.03; empty: any that has what the dialect needs

  struct Bed {
    BedShape shape = BedShape::kRectangle;
    std::array<double, 2> size_mm{100, 100};  // of a round bed: its diameter, twice
    double build_height_mm = 100;
    double margin_mm = 0;  // along its sides, where nothing is arranged
  } bed;

  struct Head {
    std::uint32_t nozzles = 128;
    double pitch_um = 137.1;               // between neighbouring nozzles, along the row
    std::vector<double> row_offset_um{0};  // nozzle i lies in row i mod rows, so far behind the first row
    double highest_frequency_hz = 5000;    // of one nozzle
    double drop_pl = 50;
    std::uint32_t max_drops = 1;         // that a nozzle can fire on a pixel in one sweep, where its dialect can say so
    std::uint32_t max_drop_sweeps = 0;   // over one place, for several drops a pixel; 0: not stated
    std::vector<std::uint32_t> blocked;  // numbers from 0
    BlockedRule blocked_rule = BlockedRule::kReport;
    std::array<double, 2> dot_gain_um{0, 0};  // how far edges of full ink stand out of their pixels along x, y; as measured
  } head;

  struct Mounting {
    double tilt_deg = 90;  // of the row of nozzles against the X axis; not used if dpi is set
    double dpi = 0;        // across the scan: the tilt follows from it; 0: the dpi follow from the tilt
    double along_dpi = 0;  // along the scan; 0: as across, or ticks_per_pixel
    ScanAxis scan_axis = ScanAxis::kX;
    Side scan_from = Side::kLeft;         // where a forward sweep begins: left or right for x, front or back for y
    Side nozzle_0 = Side::kBack;          // where nozzle 0 lies: back or front for x, left or right for y
    bool first_leads = true;              // nozzle 0 goes ahead on a forward sweep, else the last nozzle
    std::uint32_t passes = 1;             // interlaced sweeps a swath: dpi across is so many times that of the head
    std::uint32_t overlap_lines = 0;      // that neighbouring swaths share
    std::uint32_t joint_shift_lines = 0;  // that swaths begin earlier than those of the layer below, round about
    FirstSwath first_swath = FirstSwath::kBed;
    std::array<double, 2> offset_mm{0, 0};  // carriage position minus bed position of nozzle 0
  } mounting;

  struct Motion {
    double encoder_dpi = 0;             // ticks of the scan's encoder an inch; 0: none, sweeps step by pixels
    std::uint32_t ticks_per_pixel = 0;  // whole ticks; 0: pixels are not tied to ticks
    LagUnit lag_unit = LagUnit::kPixel;
    bool both_directions = false;  // every other sweep runs backwards
    double scan_speed_mm_s = 100, travel_speed_mm_s = 200;
    double ramp_mm = 5;        // before the first and behind the last step of a sweep
    double layer_step_um = 1;  // of the build vat
    std::array<double, 2> safe_mm{0, 0};
    double acceleration_mm_s2 = 0;  // of the head, for the time of moves from rest to rest; 0: even speed
    std::string x_axis = "X", y_axis = "Y";
  } motion;

  struct Powder {
    std::uint32_t vats = 1;
    std::vector<std::string> materials;  // content of each vat; empty: those that a job names, in that order
    VatRule vat_rule = VatRule::kRefuse;
    std::string build_axis = "Z";
    std::vector<std::string> feed_axes{"A", "B"};
    std::string roller_axis = "U";
    double build_sign = 1, feed_sign = 1;     // of the axis when the build vat goes down, when a feed vat goes up
    double dose = 1.2;                        // height fed / height of the layer
    std::array<double, 2> roller_mm{0, 200};  // home and far end
    double roller_speed_mm_s = 50, vat_speed_mm_s = 5;
    double base_mm() const { return base_layers * base_layer_mm; }
    double spread_s = 0;  // a layer's powder cycle that the program does not spell; 0: by the movements above
    double pause_s = 0;   // a layer, in addition to all movements: drying, wiping
    std::array<double, 2> vat_depth_mm{0, 0};  // that each vat can feed when it is full; 0: not stated
    double vat_area_mm2 = 0;                   // of each; 0: that of the bed
    VatRefill refill = VatRefill::kRefuse;
    std::uint32_t base_layers = 0;                         // spread below the first layer, without a drop
    double base_layer_mm = 0.1;                            // thickness of each
    double dry_s = 0;                                      // pause of the program behind the last sweep of each layer
    std::vector<std::string> dry_on_lines, dry_off_lines;  // the machine's own around it: a lamp
    double roller_rpm = 0;              // of a roller that turns against its way while it spreads; 0: not stated
    double packing = 0.6;               // share of the powder bed that is solid
    double evaporates_percent = 0;      // of the jetted binder, before the next layer is spread
    double min_saturation_percent = 0;  // of the voids, that binds; 0: not stated
    double min_wall_mm = 0;             // that holds when it is taken out; 0: not stated
  } powder;

  /// Keeps the nozzles from drying: firing off the bed, and wiping. Positions are those of the carriage.
  struct Maintenance {
    std::uint32_t spit_layers = 0, wipe_layers = 0;  // before the sweeps of every so many layers, from the first; 0: never
    double spit_seconds = 0, wipe_seconds = 0;       // and at most so long before the end of any sweep; 0: no limit
    std::uint32_t spit_drops = 100;                  // of each nozzle that is not blocked
    std::optional<std::array<double, 2>> spit_mm;    // where the head fires
    std::optional<std::array<double, 4>> wipe_mm;    // x, y from where and to where the head goes over its wiper
    double wipe_speed_mm_s = 50;
    std::vector<std::string> wipe_lines;          // the machine's own, behind the way over the wiper: a pump, a valve
    std::optional<std::array<double, 2>> cap_mm;  // where the head waits in pauses; else its safe place

    bool spits() const { return spit_layers > 0 || spit_seconds > 0; }
    bool wipes() const { return wipe_layers > 0 || wipe_seconds > 0; }
  } maintenance;

  /// Prices, in units of the currency; 0: none. Powder by volume is that of the bed, as fed.
  struct Cost {
    std::string currency = "EUR";
    double hour_price = 0;  // of the machine
    double binder_price_l = 0;
    double powder_price_l = 0, powder_price_kg = 0, powder_kg_l = 0;  // a litre's price, or that of a kg and a litre's mass
    double powder_reuse = 0;                                          // share of unbound powder that is used again
    std::uint32_t spit_drops = 0;                                     // a layer, off the bed: they count as binder
  } cost;
};

/// Area of what vats feed from, mm2.
inline double fed_area_mm2(const Machine& machine) {
  if (machine.powder.vat_area_mm2 > 0) return machine.powder.vat_area_mm2;
  const double side = machine.bed.size_mm[0] * machine.bed.size_mm[1];
  return machine.bed.shape == BedShape::kRound ? side * 3.14159265358979 / 4 : side;
}

/// A powder that parts of a job are of.
struct JobMaterial {
  std::string name;       // empty if no part names one
  std::uint32_t vat = 0;  // of the machine, from 0
  bool operator==(const JobMaterial&) const = default;
};

}  // namespace lamina
