// stages/replay/brundlefab/firmware.h: the BrundleFab's firmware and printhead: lines as it reads them, its ink bar.
//
// After GCode::_line_update, GCode::_line_parse and InkBar.h of github.com/ezrec/BrundleFab-firmware at 96cc39e, and
// BrundleInk.ino, dotline.cpp, Axis_DCEncoder.h of github.com/ezrec/BrundleFab-printhead at a2da357.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "stages/data/status.h"

namespace lamina::replay::brundle {

/// A command and its words. Words are 32-bit floats; a letter that the firmware does not know, with its number, is skipped.
struct Block {
  char code = 0;  // G, M, T; 0: none
  int command = 0;
  std::array<float, 13> value{};
  std::uint32_t words = 0;  // one bit per value that is given
  std::string text;         // of M117

  static constexpr std::string_view kLetters = "XYZEFIJKLPQRS";
  bool has(char letter) const { return (words >> kLetters.find(letter) & 1) != 0; }
  float operator[](char letter) const { return value[kLetters.find(letter)]; }
};

/// Numbers are read as two integers of 16 bits, before and behind the point; the sign belongs to the former alone, so that
/// -1.5 is -0.5.
/// millimetres  of a unit, for X, Y, Z, E and F: 1 or 25.4
/// errors       kVerification: a number that overflows, a checksum, a line too long
Status read_block(std::string_view line, float millimetres, Block& block);

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
