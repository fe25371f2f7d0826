// A layer's program as the BrundleFab's firmware carries it out (github.com/ezrec/BrundleFab-firmware at 96cc39e), with its
// printhead's (BrundleFab-printhead at a2da357). stages/program/brundlefab/README.md has the format.
//
// Commands of motion and tools wait until all axes and the bar stand (GCode::update), so that each is carried out alone;
// within one command all axes move at a time (CNC::target_set).
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "stages/replay/brundlefab/firmware.h"
#include "stages/replay/printing.h"

namespace lamina::replay {
namespace brundle {
namespace {

constexpr double kDotMm = 25.4 / 96;
constexpr double kPenMm = 195;  // fab/brundle.py, X_OFFSET_PEN: where the pen is, regardless of G10
constexpr double kBladeMm = 0;  // X_OFFSET_BLADE: where the recoater is
// Axis_DCEncoder spreads 5250 ticks of 600 dpi and the 10 before home over 222.25 mm (_mm_to_position): its dots are longer.
constexpr double kLongerDots = 5260.0 / 5250 - 1;
constexpr double kMaxXMm = 650;                    // X_MM_MAX
constexpr double kMaxMmPerMinute = 2000;           // Axis::target_set: the most if a stepper is made without a limit
constexpr std::array kTools = {0, 1, 20, 21, 22};  // BrundleFab.ino, setup()
constexpr std::array kPositionMm = {kPenMm, kPenMm, 45.0, kBladeMm, 95.0};  // of each tool on the carriage
constexpr double kBinMm = 140, kLiftedMm = 2;  // Z_MM_MAX, E_MM_MAX; the feed bin before the first layer
constexpr int kInk = 1, kRecoater = 21;
enum Axis : std::size_t { kX, kY, kZ, kE };

class Firmware {
 public:
  explicit Firmware(Printing& printing) : printing_(printing) {
    const auto& powder = printing.profile().powder;
    axis_x_ = powder.roller_mm[0];  // the layer before ends there, with the recoater
    position_[kX] = static_cast<float>(axis_x_);
  }

  void line(std::string_view text, std::size_t number) {
    number_ = number;
    Block block;
    if (const Status read = brundle::read_block(text, unit_mm_, block); !read) return fault(read.error().message);
    if (ended_) return fault("continues after its end");
    switch (block.code) {
      case 'M': return message(block);
      case 'T': return tool(block);
      case 'G': return motion(block);
      default:
        if (text.find_first_not_of(" \t\r") < text.find(';')) fault(fmt::format("'{}' is no command of the firmware", text));
    }
  }
  void end_of_program() {
    if (!ended_) return printing_.fault("the program ends before its last line");
    printing_.build_vat_goes_down(moved_mm_[kZ] - base_mm());
    end_of_bar();
    for (const auto& [axis, name] : {std::pair{kZ, "part"}, {kE, "feed"}}) {
      if (std::abs(spread_mm_[axis] - moved_mm_[axis]) < 1e-3) continue;
      printing_.fault(fmt::format("the {} bin is at {:g} mm when powder is spread, and at {:g} when the layer ends", name,
                                  spread_mm_[axis], moved_mm_[axis]));
    }
  }

 private:
  void fault(std::string_view what) { printing_.fault(fmt::format("line {}: {}", number_, what)); }
  /// Of powder below this layer, fed with it.
  double base_mm() const { return printing_.layer() == 0 ? printing_.profile().powder.base_mm() : 0; }
  /// What the next layer relies on.
  void end_of_bar() {
    if (!bar_.is_empty() || inked_[0] != inked_[1]) {
      printing_.fault(fmt::format("the bar holds {} dots when the layer ends, and inked {} drops on the way there, {} back",
                                  bar_.loaded(), inked_[0], inked_[1]));
    }
    if (tool_ != kRecoater) printing_.fault(fmt::format("the layer ends with tool {}, not with the recoater", tool_));
    if (relative_) printing_.fault("the layer ends in relative moves");
  }
  void unknown(const Block& block) { fault(fmt::format("'{}{}' is no command that a layer has", block.code, block.command)); }

  // M117 is carried out at once (GCode::_process_block); it marks where a layer begins and ends.
  void message(const Block& block) {
    if (block.command != 117) return unknown(block);
    const std::string want = fmt::format("{} {}", begun_ ? "Done" : "Slice", printing_.layer() + 1);
    if (!block.text.starts_with(want) || (block.text.size() > want.size() && block.text[want.size()] != ' ')) {
      return fault("M117 is not of this layer");
    }
    if (!begun_) read_layers(std::string_view(block.text).substr(want.size()));
    ended_ = begun_;
    begun_ = true;
  }

  /// " of 9"
  void read_layers(std::string_view text) {
    constexpr std::string_view kOf = " of ";
    std::uint32_t layers = 0;
    if (text.starts_with(kOf)) text.remove_prefix(kOf.size());
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), layers);
    if (error != std::errc() || end != text.data() + text.size()) return fault("M117 does not state the number of layers");
    printing_.state_layers(layers);
  }

  // GCode::_block_do, 'T': stop, select, parameters, start.
  void tool(const Block& block) {
    if (std::ranges::find(kTools, block.command) == kTools.end())
      return fault(fmt::format("there is no tool {}", block.command));
    const bool change = block.command != tool_;
    if (change && tool_ == kInk) carry_out(bar_.deselect(), false);
    tool_ = block.command;
    parameters(block, tool_);
    if (change && tool_ == kInk) bar_.select();
  }

  // tool_parms. InkBar::parm_set knows P and S; Q and R are stored and not used.
  void parameters(const Block& block, int tool) {
    if (tool != kInk) return;
    if (block.has('Q') || block.has('R')) return fault("the ink bar knows no Q and no R: it has 12 nozzles, those of P");
    if (block.has('P')) {
      if (!(block['P'] >= 0 && block['P'] <= InkBar::kNozzles)) return fault("P has bits of more than 12 nozzles");
      bar_.set_pattern(block['P']);
    }
    if (!block.has('S')) return;
    bar_.set_sprays(block['S']);
    const double dots_s = printing_.profile().motion.scan_speed_mm_s / kDotMm;
    if (const auto want = std::max<std::int64_t>(1, std::llround(1000 / dots_s)); bar_.sprays() != want) {
      fault(fmt::format("S{} is {:.2f} mm/s, and the scan speed requires S{}", bar_.sprays(), kDotMm * 1000 / bar_.sprays(),
                        want));
    }
  }

  void motion(const Block& block) {
    switch (block.command) {
      case 0: return move(block, 0);
      case 1:
        if (const double feed = block['F'] * unit_mm_; block.has('F') && feed > 10) feed_mm_min_ = feed;  // converted twice
        return move(block, feed_mm_min_);
      case 10: return tool_table(block);
      case 20:
      case 21:
        unit_mm_ = block.command == 20 ? 25.4f : 1.0f;
        unit_stated_ = true;
        return;
      case 28: return home(block);
      case 90:
      case 91:
        relative_ = block.command == 91;
        mode_stated_ = true;
        return;
      default: unknown(block);
    }
  }

  // G10 L1: at once, before up to four commands that wait; P is the tool, and its parameter too.
  void tool_table(const Block& block) {
    if (!block.has('L') || block['L'] != 1 || !block.has('P')) return unknown(block);
    if (moved_) return fault("G10 after the first move of a layer overtakes moves that wait");
    const auto tool = static_cast<int>(block['P']);
    const auto found = std::ranges::find(kTools, tool);
    if (found == kTools.end()) return fault(fmt::format("there is no tool {}", tool));
    if (block.has('Y') || block.has('Z') || block.has('E')) return fault("sets a tool's offset along another axis than X");
    const auto row = static_cast<std::size_t>(found - kTools.begin());
    if (block.has('X')) {
      offset_mm_[row] = block['X'];
      position_reported_[row] = true;
    }
    if (std::abs(offset_mm_[row] - kPositionMm[row]) > 1e-3) {
      return fault(fmt::format("sets tool {} at {:g} mm of the carriage, where {:g} is its position", tool, offset_mm_[row],
                               kPositionMm[row]));
    }
    parameters(block, tool);
  }

  // CNC::home. InkBar::home(float) does not override Axis::home(): the bar is not homed, but moved to Y. A layer may request
  // nothing else, since homing X or a bin loses where they stand.
  void home(const Block& block) {
    if (!block.has('Y') || block.has('X') || block.has('Z') || block.has('E')) return unknown(block);
    position_[kY] = block['Y'];
    go(0);
  }

  void move(const Block& block, double mm_min) {
    double squares = 0;
    std::array<double, 4> way{};
    for (std::size_t i = 0; i < 4; ++i) {
      if ((block.words >> i & 1) == 0) continue;
      const float before = position_[i];
      position_[i] = relative_ ? before + block.value[i] : block.value[i];
      way[i] = relative_ ? double{block.value[i]} : double{position_[i]} - before;
      squares += way[i] * way[i];
    }
    if ((block.has('Z') || block.has('E')) && !relative_) return fault("moves a bin to a height, which nothing homes");
    const double seconds = mm_min > 0 ? std::sqrt(squares) / mm_min * 60 : 0;
    if (way[kE] != 0 || way[kZ] != 0) bins(way[kE], way[kZ], seconds);
    go(seconds);
  }

  // The bins move at a time, each as fast as the common way wants, at most as their axes can.
  void bins(double feed, double part, double seconds) {
    moved_ = true;
    const double longest = std::max(std::abs(feed), std::abs(part));
    const double time = std::max(seconds, longest / kMaxMmPerMinute * 60);
    if (feed != 0) printing_.feeds(0, feed, std::abs(feed) / time);
    if (feed == 0) printing_.takes(time);
    moved_mm_[kE] += feed;
    moved_mm_[kZ] += part;
    const double top = printing_.axis_positions().build_mm, below = top + printing_.profile().powder.base_mm();
    bin_is_at("feed", kLiftedMm + printing_.profile().powder.dose * below + moved_mm_[kE]);
    bin_is_at("part", below + moved_mm_[kZ]);
    printing_.build_vat_is_at(top + moved_mm_[kZ]);  // positions below the first layer are negative
  }
  /// Axis_Stepper::update cuts what is beyond.
  void bin_is_at(std::string_view name, double mm) {
    if (mm > -1e-3 && mm < kBinMm + 1e-3) return;
    fault(fmt::format("moves the {} bin to {:g} mm, and the firmware stops it at 0 and {:g}", name, mm, kBinMm));
  }

  // CNC::target_set: every move sets all four targets, each less the offset of the tool that is selected now.
  void go(double seconds) {
    const auto tool = static_cast<std::size_t>(std::ranges::find(kTools, tool_) - kTools.begin());
    const double from = axis_x_;
    if (!unit_stated_ || !mode_stated_ || !position_reported_[tool]) {
      return fault(fmt::format("moves before {}: the firmware keeps the values of another print",
                               !unit_stated_   ? "G21 sets the unit"
                               : !mode_stated_ ? "G90 sets absolute positions"
                                               : fmt::format("G10 sets the position of tool {}", tool_)));
    }
    axis_x_ = std::clamp<double>(position_[kX] - offset_mm_[tool], 0, kMaxXMm);
    const double way = axis_x_ - from;
    carry_out(bar_.move(position_[kY]), std::abs(way) > 1e-4);
    if (way != 0) carriage(way, std::max(seconds, std::abs(way) / kMaxMmPerMinute * 60));
    if (position_[kY] > 0 && !bar_stated_) read_ahead();
    bar_stated_ = position_[kY] > 0;
  }

  void carriage(double way, double seconds) {
    moved_ = true;
    printing_.leaves_position();
    printing_.head_moves(std::abs(way), std::abs(way) / seconds, false);
    if (tool_ == kRecoater) printing_.roller_is_at(axis_x_ + kBladeMm);
    if (way > 0 && tool_ == kRecoater) spread_mm_ = moved_mm_;
    if (way < 0 && moved_mm_[kZ] < spread_mm_[kZ] + 1e-3) fault("the carriage returns over powder that has not been lowered");
  }

  /// For messages: the band that is being loaded, before it is inked.
  void read_ahead() { printing_.reading_sweep(sweep_); }

  // What the bar does in one command. Both ways go over the same dots if the carriage has not moved between them.
  void carry_out(const InkBar::Run& run, bool moving) {
    if (!run.fault.empty()) return fault(run.fault);
    for (int i = 0; i < run.passes && printing_.ok(); ++i) {
      const Pass& pass = run.pass[static_cast<std::size_t>(i)];
      if (off_bed()) {
        if (moving) return fault("inks while the carriage moves along X");
        shoot(pass);
        continue;
      }
      printing_.head_moves(pass.dots * kDotMm, kDotMm * 1000 / bar_.sprays(), true);
      if (moving) return fault("inks while the carriage moves along X");
      if (bar_.sprays() < 3) return fault(fmt::format("S{} is so fast that dots are left out", bar_.sprays()));
      if (pass.forward || std::abs(axis_x_ - inked_x_) > 1e-4) ink(pass);
      if (pass.forward) inked_x_ = axis_x_;
      for (std::int32_t dot = pass.begin; dot < pass.end; ++dot) {
        inked_[pass.forward ? 0 : 1] += static_cast<std::uint64_t>(std::popcount(bar_.dot(dot)));
      }
    }
  }

  /// Whether the pen is where the head is fired off the bed.
  bool off_bed() const {
    const auto& maintenance = printing_.profile().maintenance;
    return maintenance.spits() && maintenance.spit_mm && std::abs(axis_x_ + kPenMm - (*maintenance.spit_mm)[0]) < 1e-3;
  }

  // A dot is a drop of each nozzle that works, half of it on the way there. It may be inked nowhere over the bed.
  void shoot(const Pass& pass) {
    const auto& head = printing_.profile().head;
    const double seconds = pass.dots * 1e-3 * bar_.sprays();
    std::uint64_t drops = 0;
    for (std::int32_t dot = pass.begin; dot < pass.end && printing_.ok(); ++dot) {
      if (bar_.dot(dot) == 0) continue;
      for (std::uint32_t nozzle = 0; nozzle < head.nozzles; ++nozzle) {
        const bool blocked = std::ranges::find(head.blocked, nozzle) != head.blocked.end();
        if ((bar_.dot(dot) >> nozzle & 1) == (blocked ? 0u : 1u)) continue;
        return fault(fmt::format("a shot off the bed {} nozzle {}", blocked ? "fires blocked" : "leaves out", nozzle));
      }
      printing_.outside_bed(axis_x_ + kPenMm, (dot + 0.5) * kDotMm);
      ++drops;
    }
    inked_[pass.forward ? 0 : 1] += drops;
    if (pass.forward) return printing_.takes(seconds);
    printing_.spits(axis_x_ + kPenMm, 0, drops, seconds);
  }

  void ink(const Pass& pass) {
    const auto drops = drops_of(pass);
    if (drops.empty()) return;
    const bool against = printing_.position_of(1) < printing_.position_of(0);
    printing_.begin_sweep(sweep_++, against == pass.forward);
    printing_.go_across(axis_x_ + kPenMm);
    std::vector<std::uint64_t> words((printing_.nozzles() + 63) / 64);
    for (std::size_t i = 0; i < drops.size() && printing_.ok(); ++i) {
      const std::int32_t dot = pass.forward ? drops[i] : drops[drops.size() - 1 - i];
      printing_.at_step(printing_.step_at((dot + 0.5) * kDotMm));
      words.assign(words.size(), 0);
      for (std::uint32_t nozzle = 0; nozzle < 12; ++nozzle) {
        if ((bar_.dot(dot) >> nozzle & 1) == 0) continue;
        if (nozzle >= printing_.nozzles()) return fault(fmt::format("nozzle {} does not exist", nozzle));
        words[0] |= std::uint64_t{1} << (63 - nozzle);
      }
      const double late_um = (dot + 0.5) * kDotMm * 1000 * kLongerDots;
      printing_.count.farthest_along_um = std::max(printing_.count.farthest_along_um, late_um);
      printing_.fire_words(words);
    }
  }
  std::vector<std::int32_t> drops_of(const Pass& pass) const {
    std::vector<std::int32_t> drops;
    for (std::int32_t dot = pass.begin; dot < pass.end; ++dot) {
      if (bar_.dot(dot) != 0) drops.push_back(dot);
    }
    return drops;
  }

  Printing& printing_;
  InkBar bar_;
  std::size_t number_ = 0;
  float unit_mm_ = 1;
  bool relative_ = false;
  double feed_mm_min_ = 3000;        // GCode::begin
  std::array<float, 4> position_{};  // CNC::_pos: X of the tool
  std::array<double, kTools.size()> offset_mm_{};
  std::array<bool, kTools.size()> position_reported_{};
  bool unit_stated_ = false, mode_stated_ = false;
  int tool_ = kRecoater;                  // the layer before ends with it
  double axis_x_ = 0, inked_x_ = -1;      // of the carriage
  std::array<double, 4> moved_mm_{};      // of the bins since the layer began
  std::array<double, 4> spread_mm_{};     // the same when powder was spread
  std::array<std::uint64_t, 2> inked_{};  // drops, on the way there and back
  std::uint32_t sweep_ = 0;
  bool begun_ = false, ended_ = false, moved_ = false, bar_stated_ = false;
};

}  // namespace
}  // namespace brundle

void read_brundlefab(std::string_view text, Printing& printing) {
  brundle::Firmware firmware(printing);
  std::size_t number = 0;
  while (!text.empty() && printing.ok()) {
    const std::size_t end = text.find('\n');
    ++number;
    if (end == std::string_view::npos) return printing.fault(fmt::format("line {}: the program ends within a line", number));
    firmware.line(text.substr(0, end), number);
    text.remove_prefix(end + 1);
  }
  if (printing.ok()) firmware.end_of_program();
}

}  // namespace lamina::replay
