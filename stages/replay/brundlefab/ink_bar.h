// stages/replay/brundlefab/ink_bar.h: the bar that the BrundleFab's head runs along, with the buffer of its controller.
//
// After InkBar.h of github.com/ezrec/BrundleFab-firmware at 96cc39e, and BrundleInk.ino, dotline.cpp, Axis_DCEncoder.h of
// github.com/ezrec/BrundleFab-printhead at a2da357.
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace lamina::replay::brundle {

/// A movement of the head along the bar. Dots from `begin` up to `end` are inked with what the buffer holds.
struct Pass {
  bool forward = true;
  std::int32_t begin = 0, end = 0;
  std::int32_t dots = 0;  // that it goes over
};

/// Y is no axis: it says up to where the buffer is filled, with the pattern that T1 P set last, for any tool and
/// word; a smaller Y lets the head run. Nothing but the end of a reverse run empties the buffer, and what it held before stays
/// in its memory: the head inks that if it runs out over the end.
class InkBar {
 public:
  static constexpr std::int32_t kDots = 840;         // SCAN_WIDTH_DOT
  static constexpr std::int32_t kBrakes = 2;         // ink is off 9 ticks before a target, 1.44 dots (Axis_DCEncoder::update)
  static constexpr std::uint16_t kUnknown = 0x8000;  // memory of which the program knows nothing
  static constexpr std::uint16_t kNozzles = 0x0FFF;  // 'l' keeps 12 bits

  InkBar() { memory_.fill(kUnknown); }

  /// Passes of one command, in their order; at most two.
  struct Run {
    std::array<Pass, 2> pass{};
    int passes = 0;
    std::string fault;  // what the bar cannot do as meant; empty if all is well
  };

  void set_pattern(float p) { pattern_ = static_cast<std::uint16_t>(p); }  // InkBar::parm_set
  /// 's', which the printhead counts from 0.
  void set_sprays(float s) { sprays_ = s < 1 ? 1 : static_cast<std::uint16_t>(s); }
  /// Milliseconds that the head spends on a dot; it sprays in every second one (BrundleInk.ino, loop).
  std::int32_t sprays() const { return sprays_; }

  /// InkBar::stop, Tool::start: a T command that deselects or selects the tool of the bar.
  Run deselect();
  void select() { active_ = true; }

  /// InkBar::target_set. errors  Run::fault: a Y beyond the bar, or within a quarter of a dot from the next: it is cut off
  Run move(float mm);

  std::int32_t loaded() const { return loaded_; }
  /// Nothing is loaded, and the head is at home.
  bool is_empty() const { return loaded_ == 0 && filled_ == 0 && head_ == 0; }
  /// What is fired at a dot; of memory that was never written, nothing.
  std::uint16_t dot(std::int32_t at) const {
    return at < 0 || at >= kDots || memory_[index(at)] == kUnknown ? 0 : memory_[index(at)];
  }

 private:
  static std::size_t index(std::int32_t at) { return static_cast<std::size_t>(at); }
  void load(std::int32_t count);
  void repeat(std::int32_t count);
  void run_forward(Run& run);
  void run_reverse(Run& run);
  void check_turn(Run& run) const;

  std::array<std::uint16_t, kDots + 1> memory_{};  // one more, which dotline_set_range may spoil
  std::int32_t loaded_ = 0;                        // _dotline of the firmware
  std::int32_t filled_ = 0;                        // line_total of the printhead
  std::int32_t head_ = 0;
  std::uint16_t pattern_ = 0, sprays_ = 1;
  bool active_ = false;
};

}  // namespace lamina::replay::brundle
