#include "stages/replay/brundlefab/firmware.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

constexpr float kDotsPerMm = 96.0f / 25.4f;  // Y_MOTOR of pinout-brundle.h and pinout-ramps.h

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

InkBar::Run InkBar::deselect() {
  Run run;
  if (active_ && loaded_ > 0) run_forward(run);
  active_ = false;
  return run;
}

InkBar::Run InkBar::move(float mm) {
  Run run;
  // Sums of relative moves can pass any number.
  const float dots = std::clamp(mm * kDotsPerMm, -1e6f, 1e6f);
  const auto to = static_cast<std::int32_t>(dots);  // cut off, not rounded
  const float behind = dots - static_cast<float>(to);
  if (to < loaded_) {
    if (active_) run_forward(run);
    run_reverse(run);
  } else if (to > loaded_) {
    if (to > kDots) {
      run.fault = fmt::format("Y{:.4f} is dot {}, and the bar has {}", mm, to, kDots);
    } else if (behind < 0.25f || behind > 0.75f) {
      run.fault = fmt::format("Y{:.4f} is {:.2f} dots, of which the firmware cuts off what is behind the point", mm, dots);
    }
    load(std::min(to, kDots + 1) - loaded_);
  }
  return run;
}

// 'l' and, for more than one dot, 'r'.
void InkBar::load(std::int32_t count) {
  loaded_ += count;
  if (filled_ < kDots) memory_[index(filled_++)] = pattern_ & kNozzles;
  if (count > 1) repeat(count - 1);
}

// dotline_set_range. Two dots share three bytes; their bytes are made wrongly, so that of a repeated abc there are
// ab(a|c) and bc0, and nothing is repeated once at an even dot. Blank dots come out right but for that.
void InkBar::repeat(std::int32_t count) {
  if (filled_ >= kDots) return;
  count = std::min(count, kDots - filled_);
  const std::uint16_t last = filled_ > 0 ? memory_[index(filled_ - 1)] & kNozzles : std::uint16_t{0};
  const bool odd = (filled_ & 1) != 0;
  if (odd) memory_[index(filled_)] = last;
  if (count == 1) {
    filled_ += odd ? 1 : 0;
    return;
  }
  const auto even_dot = static_cast<std::uint16_t>(last | last >> 8);
  const auto odd_dot = static_cast<std::uint16_t>(last << 4 & kNozzles);
  const std::int32_t begin = filled_ + (odd ? 1 : 0), end = filled_ + count;
  for (std::int32_t at = begin; at < end; at += 2) {
    memory_[index(at)] = even_dot;
    memory_[index(at + 1)] = odd_dot;
  }
  if ((end - begin) % 2 != 0) memory_[index(odd ? std::min(end, kDots) : end - 1)] = last;
  filled_ = end;
}

// 'i', inkto(line_total): from where the head is.
void InkBar::run_forward(Run& run) {
  if (head_ < filled_) {
    Pass& pass = run.pass[index(run.passes++)];
    pass = {true, head_ == 0 ? kBrakes : head_, filled_ - kBrakes, filled_ - head_};
    check_turn(run);
  }
  head_ = filled_;
}

// 'j', inkto(0), and 'k': the buffer is empty, its memory is not.
void InkBar::run_reverse(Run& run) {
  if (head_ > 0) {
    Pass& pass = run.pass[index(run.passes++)];
    pass = {false, kBrakes, head_ - kBrakes, head_};
    check_turn(run);
  }
  head_ = filled_ = loaded_ = 0;
}

// Ink is on for a moment wherever the head stands when it turns: brakes before its target, or runs out beyond it.
void InkBar::check_turn(Run& run) const {
  const auto blank = [&](std::int32_t from, std::int32_t to) {
    for (std::int32_t at = std::max(from, 0); at < std::min(to, kDots + 1); ++at) {
      if (memory_[index(at)] != 0) return at;
    }
    return -1;
  };
  if (!run.fault.empty()) return;
  if (const std::int32_t at = blank(0, kBrakes); at >= 0) {
    run.fault = fmt::format("dot {} is loaded where the head starts and turns, ink on or off", at);
  } else if (const std::int32_t last = blank(filled_ - kBrakes, filled_); last >= 0) {
    run.fault = fmt::format("dot {} is loaded where the head brakes, before dot {}, ink on or off", last, filled_);
  } else if (const std::int32_t old = blank(filled_, filled_ + kBrakes); old >= 0) {
    run.fault = fmt::format("the head turns at dot {}, where an earlier band is still in the buffer's memory", old);
  }
}

}  // namespace lamina::replay::brundle
