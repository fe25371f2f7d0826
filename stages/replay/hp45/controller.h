// stages/replay/hp45/controller.h: the HP45 controller V4, as its firmware has it: fed with lines, moved along its encoder.
//
// Source: yvodehaas/HP45-standalone-V4, commit c6658bd (version 0.08). Each member names the function that it follows. Time
// is left out: a burst is fired wherever a nozzle is on, at every step of the image, which is what the firmware's clock does
// at the right density and a steady speed.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "stages/data/status.h"

namespace lamina::replay::hp45 {

constexpr std::uint32_t kCartridgeNozzles = 300;
constexpr double kHalfRowGapUm = 2025;  // Position.ino: half of ROW_GAP, from the centre of the head to a row

/// The nozzles of a burst: 299 in the highest bit of the first word, 0 in the 300th bit, as lines spell them.
using Burst = std::array<std::uint64_t, 5>;

class Controller {
 public:
  /// at_um  where the head stands along the scan
  explicit Controller(double at_um = 0);

  /// Carries out a line, as SerialCommand::Update and SerialExecute do, with the head at rest.
  /// command  letters before the first blank; rest: what follows it
  /// errors  kVerification: the controller drops the line, does something else or is beyond its limits
  Status execute(std::string_view command, std::string_view rest);

  /// What one row of nozzles fires on a way; the rows' positions are true ones along the scan.
  struct Firing {
    std::uint32_t row = 0;   // 0: odd nozzles, 1: even ones
    std::uint32_t line = 0;  // of the buffer
    double from_um = 0, to_um = 0;
    const Burst* burst = nullptr;
    bool steady = false;  // the speed is measured, so that bursts come at its rate
  };
  using Watch = std::function<void(const Firing&)>;
  /// Moves the centre of the head; rows that fire nothing are left out. The head rests at the end until the firmware knows it.
  /// cost  O(counts of the encoder), of an idle controller O(1)
  void move(double to_um, const Watch& watch);

  bool zeroed() const { return zeroed_; }
  /// The first command that has not come yet of those without which the controller keeps what another print has set; empty if
  /// all have come.
  std::string_view unset() const;
  std::int32_t counts_per_inch() const { return counts_per_inch_; }
  std::int32_t density() const { return density_; }
  /// Lines that a row has not come to.
  std::int32_t unread() const { return std::max(read_left(0), read_left(1)); }
  /// Whether nothing can fire until another line comes: every line is read, and the last one is all off.
  bool idle() const;
  /// Burst and position of the line that came last.
  const Burst& last_burst() const { return burst_[last_]; }
  /// True position along the scan at which a position of the encoder in um stands.
  double true_um(double encoder_um) const { return encoder_um - raw_zero_ * count_um() + zero_um_; }
  double last_position_um() const { return position_[last_]; }

 private:
  double count_um() const { return 25'400.0 / counts_per_inch_; }
  Status set(std::string_view command, std::int32_t value);
  Status add(std::int32_t position, std::string_view raw);
  void set_encoder(std::int32_t position_um);
  void report(std::string_view command);
  void update_position();
  void clear_buffer();
  std::int32_t read_left(std::uint32_t side) const;
  std::int32_t write_left() const;
  void update();  // the main loop, until nothing changes
  bool update_values();
  bool update_side(std::uint32_t side);
  void update_burst();
  void get_burst();
  void skip(std::int64_t last, int direction);
  void fire(double from_um, double to_um, const Watch& watch) const;

  // Buffer.cpp
  std::vector<Burst> burst_;
  std::vector<std::int32_t> position_;
  std::array<std::int32_t, 2> read_{0, 0};
  std::int32_t write_ = 1;
  std::uint32_t last_ = 0;
  std::array<bool, 2> active_{false, false};
  std::int32_t print_mode_ = 0;
  // HP45_Standalone_V4.ino
  std::array<std::int32_t, 2> current_{0, 0}, target_{0, 0}, min_{0, 0}, max_{0, 0};
  std::array<int, 2> required_{0, 0};
  std::array<bool, 2> next_state_{false, false}, first_{true, true};
  std::array<Burst, 2> now_{};  // CurrentBurst, each row's share
  std::int32_t density_ = 100, repeat_ = 1;
  // Position.ino
  std::int32_t counts_per_inch_ = 600, raw_ = 0, base_um_ = 0, history_um_ = 0;
  std::uint32_t pulses_ = 0, measures_ = 0;  // since the last measure of speed; measures since the head rested
  int direction_ = 0;
  std::uint32_t reports_ = 0;  // a bit for each command of kSettings
  // the head
  bool zeroed_ = false;
  double at_um_ = 0, zero_um_ = 0;
  std::int32_t raw_zero_ = 0;
};

}  // namespace lamina::replay::hp45
