// tests/replay/hp45_port.h: the HP45 controller in time, written from its firmware alone, to be compared with stages/replay.
//
// yvodehaas/HP45-standalone-V4 c6658bd. Where the decoder goes from count to count of the encoder, this one turns the main
// loop with a clock, measures the speed as Position.ino does and fires bursts when micros() says so.
#pragma once

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace lamina::firmware {

class Hp45Port {
 public:
  using Nozzles = std::bitset<300>;  // number 0 of the firmware first
  /// What a row shows where it passes a step of a raster, and what the clock fires: centre of the row along the scan in um,
  /// and across in mm as G-code has it.
  struct Findings {
    int row = 0;
    double along_um = 0, across_mm = 0;
    Nozzles nozzles;
    bool steady = false;  // the speed was measured twice since the head rested
  };

  /// along, across  letters of the axes
  /// origin, pitch  a raster along the scan, in um, at whose points rows are looked at
  Hp45Port(char along, char across, double origin_um, double pitch_um)
      : along_(along), across_(across), origin_(origin_um), pitch_(pitch_um) {}

  std::vector<Findings> shown, fired;
  std::uint64_t unknown = 0;  // lines that the controller answers with "Unknown command"
  double tick_us = 5;         // of the main loop
  bool clocked = false;       // keeps the bursts

  void run(const std::string& program) {
    std::istringstream lines(program);
    for (std::string line; std::getline(lines, line);) {
      if (line[0] == 'G' || line[0] == 'M' || line[0] == '$') {
        motion(line);
      } else {
        serial(line);
        for (int turn = 0; turn < 100; ++turn) loop();
        measures_ = 0;
      }
    }
  }

 private:
  struct Row {
    long at = 0, shot_at = 0, target = 0, low = 0, high = 0, want = 0;
    std::size_t read = 0;
    bool next = false, first = true, on = false;
    Nozzles now;
  };
  struct Stored {
    long at = 0;
    Nozzles nozzles;
  };

  // --- the host and the motion controller: everything waits for the end of a move
  void motion(const std::string& line) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    const bool moves = word == "G1" || word == "G0";
    if (word == "G90" || word == "G91") relative_ = word == "G91";
    if (word == "G4") rest(400'000);
    std::map<char, double> to;
    while (moves && words >> word) to[word[0]] = std::strtod(word.c_str() + 1, nullptr);
    if (to.count('F') != 0) speed_ = to['F'] / 60;
    if (to.count(across_) != 0) position_[across_] = to[across_] + (relative_ ? position_[across_] : 0);
    if (to.count(along_) != 0) go((to[along_] + (relative_ ? position_[along_] : 0)) * 1000);
  }
  void go(double to_um) {
    const double from = x_, way = to_um - from, needs = std::abs(way) / (speed_ * 1e-3);  // us
    for (double spent = tick_us; spent < needs; spent += tick_us) {
      x_ = from + way * spent / needs;
      loop();
    }
    x_ = to_um;
    position_[along_] = to_um / 1000;
    loop();
    rest(400'000);
  }
  void rest(double us) {
    measures_ = 0;
    clock_ += us;
    loop();
  }

  // --- Serialcom.cpp, SerialExecute
  static int six(char c) {
    static const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    return static_cast<int>(digits.find(c));
  }
  void serial(const std::string& line) {
    std::istringstream blocks(line);
    std::string command, small, raw;
    blocks >> command >> small >> raw;
    long value = 0;
    for (const char c : small) value = c == '-' ? 0 : value * 64 + six(c);
    if (!small.empty() && small[0] == '-') value = -value;
    if (command == "SBR") {
      Stored made{value, {}};
      std::size_t nozzle = 0;
      for (auto c = raw.rbegin(); c != raw.rend(); ++c) {
        for (int bit = 0; bit < 6 * repeat_ && nozzle < 300; ++bit) made.nozzles[nozzle++] = six(*c) >> (bit / repeat_) & 1;
      }
      if (buffer_.size() - std::min(rows_[0].read, rows_[1].read) <= 4000) buffer_.push_back(made);
    } else if (command == "BCL" || command == "BRES") {
      if (command == "BCL") buffer_.assign(1, {});
      for (Row& row : rows_) row.read = 0, row.first = true;
    } else if (command == "SEP") {
      counts_ = value * per_inch_ / 25'400;
      base_ = counts_;
      zero_ = x_;
    } else if (command == "SER") {
      per_inch_ = value;
    } else if (command == "SDP") {
      repeat_ = static_cast<int>(600 / value);
    } else if (command == "SDN") {
      density_ = value;
    } else if (command != "SPME" && command != "SSID" && command != "BMOD" && command != "BRL") {
      ++unknown;
    }
  }

  // --- UpdateAll
  void loop() {
    clock_ += tick_us;
    position();
    values();
    bursts();
    inspection();
  }
  void position() {
    const long counted = base_ + std::lround((x_ - zero_) * static_cast<double>(per_inch_) / 25'400);
    if (counted != detected_) {
      detected_ = counted;
      um_ = static_cast<long>(static_cast<double>(counted) * 25'400 / static_cast<double>(per_inch_));
      if (++pulses_ >= 50) {
        pulses_ = 0;
        ++measures_;
        const double per_us = static_cast<double>(um_ - measured_um_) / (clock_ - measured_at_);
        velocity_ = static_cast<long>(per_us * 1000);
        direction_ = velocity_ > 0 ? 1 : velocity_ < 0 ? -1 : 0;
        measured_um_ = um_;
        measured_at_ = clock_;
      }
    }
    if (clock_ - measured_at_ > 100'000) velocity_ = 0;
    rows_[1].at = um_ + 2025;
    rows_[0].at = um_ + 2025 - 4050;
  }
  bool left(const Row& row) const { return row.read + 1 < buffer_.size(); }
  void values() {
    for (Row& row : rows_) {
      if (!row.first && !(row.want == -1 ? row.at < row.target : row.at > row.target)) continue;
      if (left(row) && !row.next) {
        row.next = true;
        ++row.read;
        load();
      }
      if (left(row) && row.next) {
        const long ahead = buffer_[row.read + 1].at;
        if (row.first) row.target = row.at, row.first = false;
        row.want = ahead >= row.target ? 1 : -1;
        row.low = std::min(ahead, row.target);
        row.high = std::max(ahead, row.target);
        row.target = ahead;
        row.next = false;
      }
      if (!left(rows_[0]) && !left(rows_[1])) rows_[0].first = rows_[1].first = true;
    }
  }
  void load() {
    // DMAPrint.cpp: two nozzles on one address and primitive, of which the later one is written last.
    static const Nozzles lost = [] {
      Nozzles made;
      for (const std::size_t n : {8, 43, 132, 172, 184, 243, 293}) made.set(n);
      return made;
    }();
    static const Nozzles even = [] {
      Nozzles made;
      for (std::size_t n = 0; n < 300; n += 2) made.set(n);
      return made;
    }();
    for (int s = 0; s < 2; ++s)
      rows_[s].now = rows_[s].on ? buffer_[rows_[s].read].nozzles & ~lost & (s == 1 ? even : ~even) : Nozzles();
  }
  void bursts() {
    bool changed = false;
    for (Row& row : rows_) {
      const bool on = row.want == direction_ && row.at > row.low && row.at < row.high && velocity_ != 0;
      changed = changed || on != row.on;
      row.on = on;
    }
    if (changed) load();
    if (velocity_ != 0)
      delay_ = std::floor(25.4e6 / static_cast<double>(std::labs(velocity_)) / (6.0 * static_cast<double>(density_)));
    if (clock_ - burst_at_ <= delay_) return;
    burst_at_ = clock_;
    if (clocked && (rows_[0].on || rows_[1].on)) keep(fired, 0), keep(fired, 1);
  }
  void keep(std::vector<Findings>& into, int s) {
    if (rows_[s].now.any()) into.push_back({s, x_ + (s == 1 ? 2025 : -2025), position_[across_], rows_[s].now, measures_ > 1});
  }
  void inspection() {
    for (int s = 0; s < 2; ++s) {
      const auto at = static_cast<long>(std::floor((x_ + (s == 1 ? 2025 : -2025) - origin_) / pitch_));
      if (at != rows_[s].shot_at && (rows_[0].on || rows_[1].on)) keep(shown, s);
      rows_[s].shot_at = at;
    }
  }

  char along_, across_;
  double origin_, pitch_;
  std::map<char, double> position_;
  bool relative_ = false;
  double speed_ = 1, x_ = 0, clock_ = 1e6;
  std::array<Row, 2> rows_;
  std::vector<Stored> buffer_{1};
  int repeat_ = 1;
  long per_inch_ = 600, density_ = 100, counts_ = 0, base_ = 0, detected_ = 0, um_ = 0, measured_um_ = 0, velocity_ = 0,
       direction_ = 0;
  int pulses_ = 0, measures_ = 0;
  double zero_ = 0, measured_at_ = 0, delay_ = 0, burst_at_ = 0;
};

}  // namespace lamina::firmware
