#include "stages/replay/brundlefab/block.h"

namespace lamina::replay::brundle {
namespace {

constexpr int kMaxInteger = 32'767;        // int of an ATmega2560
constexpr std::size_t kLongestLine = 254;  // GCODE_LINE_MAX, without its end
constexpr std::size_t kLongestText = 255;  // PATH_MAX, without its end

bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// GCode::_line_parse, a character at a time.
class LineParser {
 public:
  explicit LineParser(Block& block) : block_(block) {}

  void take(char c) {
    if (mode_ == Mode::kText) {
      if (!(is_space(c) && block_.text.empty()) && block_.text.size() < kLongestText) block_.text += c;
      return;
    }
    if (mode_ == Mode::kFloat && c == '.') {
      base_ = 1;
      fraction_ = 0;
      mode_ = Mode::kFraction;
      return;
    }
    if (c == '-') {
      sign_ = -sign_;
      return;
    }
    if (is_digit(c)) return take_digit(c - '0');
    finish();
    if (block_.code == 'M' && block_.command == 117) {
      mode_ = Mode::kText;
      return;
    }
    if (!is_space(c)) begin(c);
  }

  /// Stores the number that is being read.
  void finish() {
    if (mode_ == Mode::kInteger && into_code_) block_.command = sign_ * whole_;
    if (mode_ == Mode::kFloat) block_.value[into_] = static_cast<float>(sign_) * static_cast<float>(whole_);
    if (mode_ == Mode::kFraction) {
      block_.value[into_] =
          static_cast<float>(sign_) * static_cast<float>(whole_) + static_cast<float>(fraction_) / static_cast<float>(base_);
    }
    mode_ = Mode::kNone;
    whole_ = 0;
  }
  bool overflows() const { return overflows_; }

 private:
  enum class Mode : std::uint8_t { kNone, kInteger, kFloat, kFraction, kText };

  void take_digit(int digit) {
    int& number = mode_ == Mode::kFraction ? fraction_ : whole_;
    if (mode_ == Mode::kNone) return;
    if (number > (kMaxInteger - digit) / 10 || (mode_ == Mode::kFraction && base_ > kMaxInteger / 10)) {
      overflows_ = true;
      return;
    }
    number = number * 10 + digit;
    if (mode_ == Mode::kFraction) base_ *= 10;
  }
  void begin(char c) {
    const std::size_t letter = Block::kLetters.find(c);
    if (c == 'G' || c == 'M' || c == 'T' || c == 'N') {
      mode_ = Mode::kInteger;
      into_code_ = c != 'N';
      if (into_code_) {
        block_.code = c;
        block_.command = 0;
      }
    } else if (letter != std::string_view::npos) {
      mode_ = Mode::kFloat;
      into_ = letter;
      block_.words |= 1u << letter;
      block_.value[letter] = 0;
    } else {
      return;
    }
    sign_ = 1;
  }

  Block& block_;
  Mode mode_ = Mode::kNone;
  bool into_code_ = false, overflows_ = false;
  std::size_t into_ = 0;
  int sign_ = 1, whole_ = 0, fraction_ = 0, base_ = 1;
};

}  // namespace

Status read_block(std::string_view line, float millimetres, Block& block) {
  const auto wrong = [](const char* what) { return Error{Fault::kVerification, what}; };
  block = {};
  line = line.substr(0, line.find(';'));  // GCode::_line_update
  if (line.size() > kLongestLine) return wrong("is longer than the 254 characters that the firmware keeps");
  LineParser parser(block);
  for (const char c : line) {
    if (c == '*') return wrong("has a checksum, which no program of this dialect has");
    parser.take(c);
  }
  parser.finish();
  if (parser.overflows()) return wrong("has a number that does not fit into the firmware's 16 bits");
  for (const char letter : {'X', 'Y', 'Z', 'E', 'F'}) block.value[Block::kLetters.find(letter)] *= millimetres;
  return {};
}

}  // namespace lamina::replay::brundle
