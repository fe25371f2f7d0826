// stages/replay/brundlefab/block.h: a line of G-code as the BrundleFab's firmware reads it.
//
// After GCode::_line_update and GCode::_line_parse of github.com/ezrec/BrundleFab-firmware at 96cc39e.
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

}  // namespace lamina::replay::brundle
