// stages/formats/gcode/words.h: the words of a line of G-code, a letter and a number each, as firmwares scan them.
//
// Sources: Marlin, GCodeParser::parse() and queue.cpp; Klipper, klippy/gcode.py, GCodeDispatch._process_commands();
// RepRapFirmware, StringParser. What one of them accepts is accepted.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace lamina::formats {

/// What firmwares read differently; kDifferenceTexts of read_gcode.cpp describes each.
enum class Difference : std::uint8_t {
  kLowerCase,
  kBlank,
  kParentheses,
  kExponent,
  kTwice,
  kCr,
  kRepeat,
  kSeveral,
  kFlow,
  kFlowOfTool,
  kText,
  kCount
};

/// A line without comments (`;...`, `(...)`) and without its checksum.
/// line  without its end;  scratch  holds the result if a comment in parentheses was cut out: no allocation once it has grown
std::string_view strip_comments(std::string_view line, std::string& scratch);

/// The words of a command, by their letters.
struct GcodeWords {
  double value[26] = {};
  std::uint32_t given = 0;  // a bit a letter
  bool has(char letter) const { return given >> (letter - 'A') & 1; }
  double operator[](char letter) const { return has(letter) ? value[letter - 'A'] : 0; }
};

/// Takes words off a stripped line: a letter in any case, then a decimal number. `E` begins a word behind any digit: there are
/// no exponents. Allocates nothing.
class WordScanner {
 public:
  explicit WordScanner(std::string_view line) : left_(line) {}

  /// The next word; false at the end of the line and at what is no word: then failed().
  bool next();
  char letter() const { return letter_; }          // upper case
  bool has_number() const { return has_number_; }  // X of `G92 X` has none
  double value() const { return value_; }          // 0 without a number
  std::string_view rest() const { return word_; }  // from the word, or what is no word, to the end of the line
  std::string_view behind() const { return left_; }
  bool failed() const { return failed_; }
  bool no_number() const { return no_number_; }  // it failed behind a letter
  std::uint32_t differences = 0;                 // a bit a Difference

 private:
  bool fail(bool no_number);
  bool read_number(bool blank);

  std::string_view left_, word_;
  double value_ = 0;
  char letter_ = 0;
  bool has_number_ = false, failed_ = false, no_number_ = false;
};

constexpr std::uint32_t bit_of(Difference difference) { return 1u << static_cast<unsigned>(difference); }

}  // namespace lamina::formats
