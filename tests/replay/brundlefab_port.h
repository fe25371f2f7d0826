// The BrundleFab's two controllers, ported line by line for tests and for nothing else: what stages/replay decodes, written
// once more from the sources alone (BrundleFab-firmware at 96cc39e, BrundleFab-printhead at a2da357), down to the bytes of
// the printhead's buffer and the ticks of its motor.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <tuple>
#include <vector>

namespace lamina::brundlefab_port {

/// What the printhead does with one spray of a tick: where the carriage is, the dot that it counts, the pattern.
struct Spray {
  double carriage_mm;
  int dot;
  std::uint16_t pattern;
  bool forward, carriage_moves;
};

/// BrundleInk.ino with dotline.cpp and Axis_DCEncoder.h.
class Printhead {
 public:
  /// coast  ticks that the motor runs on when it is braked
  Printhead(int coast, std::uint32_t garbage) : coast_(coast) {
    for (auto& byte : buffer_) byte = static_cast<std::uint8_t>((garbage = garbage * 1664525u + 1013904223u) >> 24);
  }

  void command(char name, std::uint16_t value) {
    switch (name) {
      case 'l':
        if (line_total_ < 840) dotline_set(line_total_++, value & 0xfff);
        break;
      case 'r':
        line_total_ += dotline_set_range(line_total_, value, line_total_ > 0 ? dotline_get(line_total_ - 1) : std::uint16_t{0});
        break;
      case 'i': inkto(line_total_); break;
      case 'j': inkto(0); break;
      case 'k': line_total_ = 0; break;
      case 's': sprays = value + 1; break;
      default: break;
    }
  }

  std::vector<Spray> sprays_made;
  double carriage_mm = 0;
  bool carriage_moves = false;
  int sprays = 1;

 private:
  static std::size_t location(int dot) { return static_cast<std::size_t>(dot / 2 * 3 + (dot & 1)); }
  static int shift(int dot) { return (dot & 1) != 0 ? 0 : 4; }
  std::uint16_t dotline_get(int dot) const {
    const auto at = static_cast<std::uint16_t>(dot);
    if (at > 840) return 0;
    return static_cast<std::uint16_t>((buffer_[location(at)] << 8 | buffer_[location(at) + 1]) >> shift(at) & 0xfff);
  }
  void dotline_set(int dot, std::uint16_t line) {
    if (dot > 840) return;
    const int mask = 0xfff << shift(dot), bits = line << shift(dot);
    buffer_[location(dot)] = static_cast<std::uint8_t>((buffer_[location(dot)] & ~(mask >> 8)) | bits >> 8);
    buffer_[location(dot) + 1] = static_cast<std::uint8_t>((buffer_[location(dot) + 1] & ~mask) | (bits & 0xff));
  }
  int dotline_set_range(int dot, int length, std::uint16_t line) {
    int done = 0;
    if (dot >= 840) return done;
    length = std::min(length, 840 - dot);
    if ((dot & 1) != 0) {
      dotline_set(dot++, line);
      ++done;
    }
    if (length == 1) return done;
    std::size_t at = location(dot);
    for (; done < length; done += 2, at += 3) {
      buffer_[at] = static_cast<std::uint8_t>(line >> 4);
      buffer_[at + 1] = static_cast<std::uint8_t>(line << 4 | line >> 4);
      buffer_[at + 2] = static_cast<std::uint8_t>(line << 4);
    }
    if (done > length) {
      dotline_set(dot + length - 1, line);
      --done;
    }
    return done;
  }

  // 5260 ticks are 222.25 mm, the first one -10.
  static constexpr float kTicksPerMm = 5260.0f / (875.0f * 0.254f);
  static int dot_at(int tick) { return static_cast<int>(static_cast<float>(tick + 10) / kTicksPerMm / 25.4f * 96.0f); }

  // A tick at a time, slow enough for a spray on each. Ink is on as soon as the command comes, and off when the motor brakes.
  void inkto(int line) {
    const int target = std::clamp(static_cast<int>(static_cast<float>(line) / 96.0f * 25.4f * kTicksPerMm) - 10, -10, 5249);
    const int way = target > tick_ ? 1 : -1;
    spray(way > 0);
    while (std::abs(target - tick_) >= 10) {
      tick_ += way;
      spray(way > 0);
      if (std::abs(target - tick_) < 10) tick_ += way * coast_;
    }
  }
  void spray(bool forward) {
    const int dot = dot_at(tick_);
    if (const std::uint16_t pattern = dotline_get(dot); pattern != 0) {
      sprays_made.push_back({carriage_mm, dot, pattern, forward, carriage_moves});
    }
  }

  std::array<std::uint8_t, 1400> buffer_{};
  int line_total_ = 0, tick_ = -19, coast_;
};

/// GCode.cpp, CNC.h, Axis_Stepper.h (X alone), InkBar.h, Tool.h.
class Board {
 public:
  explicit Board(Printhead& head) : head_(head) {}

  void run(std::string_view program) {
    while (!program.empty()) {
      const std::size_t end = std::min(program.find('\n'), program.size());
      line(program.substr(0, end));
      program.remove_prefix(std::min(end + 1, program.size()));
    }
  }

 private:
  void line(std::string_view text) {
    char code = 0;
    int command = 0;
    std::map<char, float> word;
    for (std::size_t i = 0; i < text.size();) {
      const char letter = text[i++];
      if (code == 'M' && command == 117) return;  // the rest is a message
      int whole = 0, part = 0, base = 0, sign = 1;
      for (; i < text.size(); ++i) {
        if (text[i] == '-') {
          sign = -sign;
        } else if (text[i] == '.' && base == 0) {
          base = 1;
        } else if (text[i] >= '0' && text[i] <= '9') {
          (base == 0 ? whole : part) = (base == 0 ? whole : part) * 10 + (text[i] - '0');
          if (base > 0) base *= 10;
        } else {
          break;
        }
      }
      if (letter == 'G' || letter == 'M' || letter == 'T') {
        code = letter;
        command = sign * whole;
      } else if (std::string_view("XYZEFLPQRS").find(letter) != std::string_view::npos) {
        word[letter] = static_cast<float>(sign) * static_cast<float>(whole) +
                       (base > 0 ? static_cast<float>(part) / static_cast<float>(base) : 0.0f);
      }
    }
    for (const char axis : {'X', 'Y', 'Z', 'E', 'F'}) {
      if (word.contains(axis)) word[axis] *= unit_;
    }
    block_do(code, command, word);
  }

  void block_do(char code, int command, const std::map<char, float>& word) {
    if (code == 'T') {
      const bool change = command != tool_;
      if (change && tool_ == 1) inkbar_stop();
      if (change && offset_.contains(command)) tool_ = command;
      tool_parms(tool_, word);
      if (change && tool_ == 1) active_ = true;
    }
    if (code != 'G') return;
    if (command == 0 || command == 1) target(word, relative_);
    if (command == 28) target(word, false);  // Axis::home() does nothing on the bar, and X is at home
    if (command == 90 || command == 91) relative_ = command == 91;
    if (command == 20 || command == 21) unit_ = command == 20 ? 25.4f : 1.0f;
    if (command == 10 && word.contains('L') && word.at('L') == 1 && word.contains('P')) {
      const int tool = static_cast<int>(word.at('P'));
      if (word.contains('X')) offset_[tool] = word.at('X');
      tool_parms(tool, word);
    }
  }
  void tool_parms(int tool, const std::map<char, float>& word) {
    if (tool != 1) return;
    if (word.contains('P')) pattern_ = static_cast<std::uint16_t>(word.at('P'));
    if (word.contains('S')) head_.command('s', static_cast<std::uint16_t>(std::max(1.0f, word.at('S')) - 1));
  }

  void target(const std::map<char, float>& word, bool relative) {
    const auto set = [&](char axis, float& at) {
      if (word.contains(axis)) at = relative ? at + word.at(axis) : word.at(axis);
    };
    set('X', x_);
    set('Y', y_);
    const double before = head_.carriage_mm;
    head_.carriage_mm = std::clamp(static_cast<double>(x_ - offset_[tool_]), 0.0, 650.0);
    head_.carriage_moves = std::abs(head_.carriage_mm - before) > 1e-4;
    inkbar_target(y_);
    head_.carriage_moves = false;
  }

  void inkbar_stop() {
    if (dotline_ > 0) head_.command('i', 0);
    active_ = false;
  }
  void inkbar_target(float mm) {
    const auto position = static_cast<std::int32_t>(mm * (96.0f / 25.4f));
    if (position < dotline_) {
      if (active_) head_.command('i', 0);  // and, when that is done, InkBar::update reverses
      head_.command('j', 0);
      head_.command('k', 0);
      dotline_ = 0;
    } else if (position != dotline_) {
      head_.command('l', pattern_);
      if (position - dotline_ > 1) head_.command('r', static_cast<std::uint16_t>(position - dotline_ - 1));
      dotline_ = position;
    }
  }

  Printhead& head_;
  std::map<int, float> offset_ = {{0, 0}, {1, 0}, {20, 0}, {21, 0}, {22, 0}};
  float x_ = 0, y_ = 0, unit_ = 1;
  bool relative_ = false, active_ = false;
  int tool_ = 21;
  std::int32_t dotline_ = 0;
  std::uint16_t pattern_ = 0xFFF;
};

}  // namespace lamina::brundlefab_port
