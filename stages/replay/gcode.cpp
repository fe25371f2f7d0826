#include "stages/replay/gcode.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace lamina::replay {

std::optional<std::string_view> add_words(std::string_view text, std::map<char, double>& words) {
  while (!text.empty()) {
    const std::string_view word = text.substr(0, text.find(' '));
    double value = 0;
    const bool letter = !word.empty() && word[0] >= 'A' && word[0] <= 'Z';
    const char *const from = word.data() + (letter ? 1 : 0), *const to = word.data() + word.size();
    const auto [stop, error] = std::from_chars(from, to, value, std::chars_format::fixed);  // firmware knows no exponents
    if (!letter || error != std::errc() || stop != to || !std::isfinite(value)) return word;
    words[word[0]] = value;
    text.remove_prefix(std::min(word.size() + 1, text.size()));
  }
  return std::nullopt;
}

void GcodeReader::fault(std::string_view what) { printing_.fault(fmt::format("line {}: {}", number_, what)); }

bool GcodeReader::next(GcodeLine& line) {
  while (!left_.empty() && printing_.ok()) {
    const std::size_t end = left_.find('\n');
    if (end == std::string_view::npos) {
      ++number_;
      fault("the program ends within a line");
      return false;
    }
    now_ = left_.substr(0, end);
    left_.remove_prefix(end + 1);
    ++number_;
    now_ = now_.substr(0, now_.find(';'));
    while (now_.ends_with(' ')) now_.remove_suffix(1);
    if (now_.empty()) continue;
    if (now_[0] == 'M' && printing_.takes_own(now_)) continue;
    const std::size_t space = now_.find(' ');
    if (space == 0) {
      fault("begins with a blank");
      return false;
    }
    line.command = now_.substr(0, space);
    line.rest = space == std::string_view::npos ? std::string_view() : now_.substr(space + 1);
    line.word.clear();
    if (line.command[0] != 'G' && line.command[0] != 'M' && line.command[0] != 'T') return true;
    if (const auto wrong = add_words(line.rest, line.word)) {
      fault(fmt::format("'{}' is no word", *wrong));
      return false;
    }
    return true;
  }
  return false;
}

double GcodeReader::number(const GcodeLine& line, char letter) {
  const auto found = line.word.find(letter);
  if (found != line.word.end()) return found->second;
  fault(fmt::format("{} lacks {}", line.command, letter));
  return 0;
}

std::uint32_t GcodeReader::count(const GcodeLine& line, char letter) {
  const double value = number(line, letter);
  if (!(value >= 0 && value <= 4294967295.0) || value != std::floor(value)) {
    fault(fmt::format("{}{:g} is no count", letter, value));
    return 0;
  }
  return static_cast<std::uint32_t>(value);
}

Axes::Axes(Printing& printing, GcodeReader& reader) : printing_(printing), reader_(reader) {
  const auto& profile = printing.profile();
  const AxisPositions position = printing.axis_positions();
  at_[profile.powder.build_axis[0]] = position.build_mm;
  at_[profile.powder.roller_axis[0]] = position.roller_mm;
  at_[profile.motion.x_axis[0]] = position.x_mm;
  at_[profile.motion.y_axis[0]] = position.y_mm;
  // Oasis's spreader spreads where it turns, which its reader sees.
  roller_on_gantry_ = profile.dialect != "oasis" && printing.roller_on_gantry();
}

// One line moves one part, and no part comes into the way of another.
bool Axes::paths_are_clear(const GcodeLine& line) {
  using MovingPart = Printing::MovingPart;
  const auto& [powder, motion] = std::tie(printing_.profile().powder, printing_.profile().motion);
  const auto has = [&](const std::string& axis) { return line.has(axis[0]); };
  const bool head = has(motion.x_axis) || has(motion.y_axis);
  const bool roller = !printing_.roller_on_gantry() && has(powder.roller_axis);
  const bool vat = has(powder.build_axis) || has(powder.feed_axes[0]) || (powder.vats > 1 && has(powder.feed_axes[1]));
  if (head + roller + vat > 1) {
    reader_.fault("moves two of head, roller and vats at a time");
    return false;
  }
  if (head + roller + vat == 1)
    printing_.check_way(head ? MovingPart::kHead : roller ? MovingPart::kRoller : MovingPart::kVat, feed_mm_s_);
  return true;
}

bool Axes::take(const GcodeLine& line, bool scanning) {
  if (line.command == "G90" || line.command == "G91") {
    relative_ = line.command == "G91";
    return true;
  }
  if (line.command != "G0" && line.command != "G1") return false;
  const auto& profile = printing_.profile();
  double head_squared = 0, all_squared = 0, alone = 0;  // alone: the ways of the other axes, one after the other
  bool head = false;
  if (line.has('F')) feed_mm_s_ = line.word.at('F') / 60;
  if (!(feed_mm_s_ > 0)) {
    reader_.fault("moves at no speed");
    return true;
  }
  if (!paths_are_clear(line)) return true;
  for (const auto& [letter, value] : line.word) {
    if (letter == 'F') continue;
    double& at = at_[letter];
    const double way = relative_ ? value : value - at;
    at += way;
    way_[letter] = way;
    all_squared += way * way;
    const std::string axis(1, letter);
    if (axis == profile.motion.x_axis || axis == profile.motion.y_axis) {
      head = true;
      head_squared += way * way;
      if (roller_on_gantry_ && axis == profile.powder.roller_axis) printing_.roller_is_at(at, line.command == "G1");
    } else if (axis == profile.powder.build_axis || axis == profile.powder.roller_axis) {
      printing_.takes(std::abs(way) / feed_mm_s_);
      alone += std::abs(way);
      if (axis == profile.powder.build_axis) {
        printing_.build_vat_is_at(at);
      } else {
        printing_.roller_is_at(at);
      }
    } else if (axis == profile.powder.feed_axes[0] || (profile.powder.vats > 1 && axis == profile.powder.feed_axes[1])) {
      if (!relative_) {
        reader_.fault(fmt::format("{} feeds to a height, which depends on the layers before; G91 stands before it", letter));
        return true;
      }
      printing_.feeds(axis == profile.powder.feed_axes[0] ? 0 : 1, way * profile.powder.feed_sign, feed_mm_s_);
      alone += std::abs(way);
    } else {
      reader_.fault(fmt::format("the machine has no axis {}", letter));
      return true;
    }
  }
  // Vats and roller of one line move together: F is the speed along their common way.
  printing_.takes((std::sqrt(all_squared - head_squared) - alone) / feed_mm_s_);
  if (head_squared > 0) printing_.head_moves(std::sqrt(head_squared), feed_mm_s_, scanning);
  if (head) {  // where it stands already, too
    printing_.head_is_at(at_[profile.motion.x_axis[0]], at_[profile.motion.y_axis[0]],
                         line.command == "G1" && !scanning ? feed_mm_s_ : 0);
  }
  return true;
}

void Axes::end() {
  if (relative_) reader_.fault("the layer ends in G91, and the next one goes to places");
  if (roller_on_gantry_) printing_.roller_is_at(printing_.profile().powder.roller_mm[0]);  // where the head waits for it
}

}  // namespace lamina::replay
