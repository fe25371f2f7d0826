// stages/geometry/t6_codes.h: the code words of CCITT T.4 and T.6, as numbers and lengths.
//
// Source: ITU-T T.6 (11/88): table 1 (modes), table 2 (terminating codes), table 3 (make-up codes), and its EOFB.
// The words stand here as the Recommendation prints them, and become numbers when this is compiled.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace lamina::t6 {

/// Up to 24 significant bits of a word (its leading zeros need no room) and its length in bits.
struct Code {
  std::uint32_t packed = 0;

  constexpr Code() = default;
  constexpr Code(std::uint32_t bits, std::uint32_t length) : packed(bits << 8 | length) {}
  constexpr std::uint32_t bits() const { return packed >> 8; }
  constexpr std::uint32_t length() const { return packed & 0xFF; }
};

constexpr Code code_of(std::string_view word) {
  std::uint32_t bits = 0;
  for (char digit : word) bits = bits * 2 + (digit == '1' ? 1 : 0);
  return Code(bits, static_cast<std::uint32_t>(word.size()));
}

inline constexpr Code kPass = code_of("0001");
inline constexpr Code kHorizontal = code_of("001");
inline constexpr Code kEndOfFacsimileBlock = code_of("000000000001000000000001");

/// Vertical modes by a1 - b1 + 3: three to the left of b1 ... three to the right of it.
inline constexpr std::array<Code, 7> kVertical = {code_of("0000010"), code_of("000010"), code_of("010"),    code_of("1"),
                                                  code_of("011"),     code_of("000011"), code_of("0000011")};

/// Four vertical modes after each other, by (a1 - b1 + 3) of the first + 8 of the second + 64 + 512. Entries with a
/// 7 in them are never used.
inline constexpr std::array<Code, 4096> kFourVertical = [] {
  std::array<Code, 4096> table{};
  for (std::uint32_t index = 0; index < table.size(); ++index) {
    std::uint32_t bits = 0, length = 0;
    for (std::uint32_t position = 0; position < 4; ++position) {
      const std::uint32_t mode = index >> (3 * position) & 7;
      if (mode == 7) continue;
      bits = bits << kVertical[mode].length() | kVertical[mode].bits();
      length += kVertical[mode].length();
    }
    table[index] = Code(bits, length);
  }
  return table;
}();

/// Longest run with a make-up code of its own. Longer ones start with this code as often as it fits.
inline constexpr std::uint32_t kLongestMakeUp = 2560;

/// Two of them: the entries of the table above that have 7 in the third and fourth place.
constexpr Code two_vertical(std::uint32_t first, std::uint32_t second) {
  return kFourVertical[first | second << 3 | 7u << 6 | 7u << 9];
}

/// One colour: a run of n < 2624 is make_up[n / 64] (no bits at all for 0), then terminating[n % 64].
struct RunCodes {
  std::array<Code, 64> terminating;
  std::array<Code, 41> make_up;
};

namespace words {

inline constexpr std::array<std::string_view, 64> kWhiteTerminating = {
    "00110101", "000111",   "0111",     "1000",     "1011",     "1100",     "1110",     "1111",      // 0
    "10011",    "10100",    "00111",    "01000",    "001000",   "000011",   "110100",   "110101",    // 8
    "101010",   "101011",   "0100111",  "0001100",  "0001000",  "0010111",  "0000011",  "0000100",   // 16
    "0101000",  "0101011",  "0010011",  "0100100",  "0011000",  "00000010", "00000011", "00011010",  // 24
    "00011011", "00010010", "00010011", "00010100", "00010101", "00010110", "00010111", "00101000",  // 32
    "00101001", "00101010", "00101011", "00101100", "00101101", "00000100", "00000101", "00001010",  // 40
    "00001011", "01010010", "01010011", "01010100", "01010101", "00100100", "00100101", "01011000",  // 48
    "01011001", "01011010", "01011011", "01001010", "01001011", "00110010", "00110011", "00110100"   // 56
};
inline constexpr std::array<std::string_view, 27> kWhiteMakeUp = {
    "11011",     "10010",     "010111",    "0110111",   "00110110",  "00110111",  "01100100",   // 64
    "01100101",  "01101000",  "01100111",  "011001100", "011001101", "011010010", "011010011",  // 512
    "011010100", "011010101", "011010110", "011010111", "011011000", "011011001", "011011010",  // 960
    "011011011", "010011000", "010011001", "010011010", "011000",    "010011011"                // 1408 .. 1728
};
inline constexpr std::array<std::string_view, 64> kBlackTerminating = {
    "0000110111",   "010",          "11",           "10",           "011",          "0011",          // 0
    "0010",         "00011",        "000101",       "000100",       "0000100",      "0000101",       // 6
    "0000111",      "00000100",     "00000111",     "000011000",    "0000010111",   "0000011000",    // 12
    "0000001000",   "00001100111",  "00001101000",  "00001101100",  "00000110111",  "00000101000",   // 18
    "00000010111",  "00000011000",  "000011001010", "000011001011", "000011001100", "000011001101",  // 24
    "000001101000", "000001101001", "000001101010", "000001101011", "000011010010", "000011010011",  // 30
    "000011010100", "000011010101", "000011010110", "000011010111", "000001101100", "000001101101",  // 36
    "000011011010", "000011011011", "000001010100", "000001010101", "000001010110", "000001010111",  // 42
    "000001100100", "000001100101", "000001010010", "000001010011", "000000100100", "000000110111",  // 48
    "000000111000", "000000100111", "000000101000", "000001011000", "000001011001", "000000101011",  // 54
    "000000101100", "000001011010", "000001100110", "000001100111"                                   // 60
};
inline constexpr std::array<std::string_view, 27> kBlackMakeUp = {
    "0000001111",    "000011001000",  "000011001001",  "000001011011",  "000000110011",   // 64
    "000000110100",  "000000110101",  "0000001101100", "0000001101101", "0000001001010",  // 384
    "0000001001011", "0000001001100", "0000001001101", "0000001110010", "0000001110011",  // 704
    "0000001110100", "0000001110101", "0000001110110", "0000001110111", "0000001010010",  // 1024
    "0000001010011", "0000001010100", "0000001010101", "0000001011010", "0000001011011",  // 1344
    "0000001100100", "0000001100101"                                                      // 1664, 1728
};
/// Of both colours.
inline constexpr std::array<std::string_view, 13> kLongMakeUp = {
    "00000001000",  "00000001100",  "00000001101",  "000000010010", "000000010011", "000000010100", "000000010101",
    "000000010110", "000000010111", "000000011100", "000000011101", "000000011110", "000000011111"  // 1792 .. 2560
};

constexpr RunCodes run_codes(const std::array<std::string_view, 64>& terminating,
                             const std::array<std::string_view, 27>& make_up) {
  RunCodes codes{};
  for (std::size_t i = 0; i < 64; ++i) codes.terminating[i] = code_of(terminating[i]);
  codes.make_up[0] = Code(0, 0);
  for (std::size_t i = 0; i < 27; ++i) codes.make_up[1 + i] = code_of(make_up[i]);
  for (std::size_t i = 0; i < 13; ++i) codes.make_up[28 + i] = code_of(kLongMakeUp[i]);
  return codes;
}

}  // namespace words

/// [0] white, [1] black.
inline constexpr std::array<RunCodes, 2> kRunCodes = {words::run_codes(words::kWhiteTerminating, words::kWhiteMakeUp),
                                                      words::run_codes(words::kBlackTerminating, words::kBlackMakeUp)};

}  // namespace lamina::t6
