#include "stages/replay/frame.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "stages/replay/gcode.h"

namespace lamina::replay {
namespace {

Error wrong(std::string what) { return {Fault::kVerification, std::move(what)}; }

struct ProgramLine {
  std::size_t number = 0;  // from 1
  std::string command;
  std::map<char, double> word;

  bool has(char letter) const { return word.contains(letter); }
  /// NaN if there is none.
  double value(char letter) const { return has(letter) ? word.at(letter) : std::nan(""); }
};

/// Without comments and empty lines; only G, M and T commands have words, and M117 has text.
/// errors  kVerification, with the line: a word that is no letter and number, an end within a line
Result<std::vector<ProgramLine>> lines_of(std::string_view text) {
  std::vector<ProgramLine> lines;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos) return wrong(fmt::format("line {}: ends within a line", number));
    std::string_view left = text.substr(0, end);
    text.remove_prefix(end + 1);
    left = left.substr(0, left.find(';'));
    while (left.ends_with(' ')) left.remove_suffix(1);
    if (left.empty()) continue;
    ProgramLine line;
    line.number = number;
    line.command = left.substr(0, left.find(' '));
    left.remove_prefix(std::min(line.command.size() + 1, left.size()));
    const bool has_words = std::string_view("GMT").find(line.command[0]) != std::string_view::npos && line.command != "M117";
    if (const auto what = has_words ? add_words(left, line.word) : std::nullopt)
      return wrong(fmt::format("line {}: '{}' is no word", number, *what));
    lines.push_back(std::move(line));
  }
  return lines;
}

/// What lines of G-code leave behind them.
struct GcodeState {
  bool millimetres = false, absolute = false;
  std::map<char, double> zeroed;  // axes by G92
  std::map<char, double> at;      // and where they then go
};

/// Units, modes, zeros and ways; false for any other command.
bool take(const ProgramLine& line, GcodeState& state) {
  if (line.command == "G20" || line.command == "G21") {
    state.millimetres = line.command == "G21";
  } else if (line.command == "G90" || line.command == "G91") {
    state.absolute = line.command == "G90";
  } else if (line.command == "G92") {
    for (const auto& [letter, value] : line.word) state.zeroed[letter] = state.at[letter] = value;
  } else if (line.command == "G0" || line.command == "G1") {
    for (const auto& [letter, value] : line.word) state.at[letter] = value;
  } else {
    return false;
  }
  return true;
}

Status check_modes(const GcodeState& state) {
  if (!state.millimetres) return wrong("G21 is missing: layers are in mm");
  return state.absolute ? Status() : wrong("G90 is missing: layers use absolute positions");
}

/// Layers begin with the build vat's axis at 0, or as far above it as the base is high.
Status check_zero(const Machine& machine, const GcodeState& state) {
  const auto& powder = machine.powder;
  const auto zero = state.zeroed.find(powder.build_axis[0]);
  const double want = -powder.build_sign * powder.base_mm();
  if (zero == state.zeroed.end() ? powder.base_layers > 0 : std::abs(zero->second - want) > 1e-3) {
    return wrong(fmt::format("the build vat's axis is set to {:g} mm where {:g} have to be",
                             zero == state.zeroed.end() ? 0.0 : zero->second, want));
  }
  return {};
}

Status check_header(const VirtualMachine& machine, const ProgramLine& line) {
  const VirtualMachine::Counts want = machine.counts();
  const std::pair<char, double> words[] = {{'L', machine.layers() > 0 ? machine.layers() : line.value('L')},
                                           {'N', want.nozzles},
                                           {'W', want.positions},
                                           {'K', want.steps},
                                           {'Q', std::round(want.step_um * 1e6) / 1e3}};
  for (const auto& [letter, value] : words) {
    if (std::abs(line.value(letter) - value) > (letter == 'Q' ? 2e-3 : 0)) {
      return wrong(
          fmt::format("line {}: M810 says {}{:g} where {:g} have to be", line.number, letter, line.value(letter), value));
    }
  }
  return {};
}

Status start_of_gcode(const VirtualMachine& machine, std::string_view text) {
  const Machine& profile = machine.profile();
  const bool nuferbj = profile.dialect == "nuferbj", oasis = profile.dialect == "oasis";
  GcodeState state;
  bool header = false, homed = false;
  auto lines = lines_of(text);
  if (!lines) return lines.error();
  for (const ProgramLine& line : *lines) {
    if (nuferbj && line.command == "M810") {
      if (Status status = check_header(machine, line); !status) return status;
      header = true;
    } else if (oasis && line.command == "$h") {
      homed = true;
      state = {};
    } else if (!take(line, state)) {
      return wrong(fmt::format("line {}: '{}' is no command of a program's begin", line.number, line.command));
    }
    if (oasis && !homed) return wrong(fmt::format("line {}: '{}' before $h has homed the gantry", line.number, line.command));
  }
  if (nuferbj && !header) return wrong("M810 is missing, which states nozzles and steps");
  if (Status status = check_modes(state); !status) return status;
  if (Status status = check_zero(profile, state); !status || !oasis) return status;
  // Where homing leaves the gantry (SerialGRBL.py, Home), and from where the layers begin.
  const char x = profile.motion.x_axis[0], y = profile.motion.y_axis[0];
  const char feed = profile.powder.feed_axes[0][0];
  if (state.zeroed[x] != 5 || state.zeroed[y] != 245) return wrong("G92 has to say that homing leaves the gantry at 5, 245 mm");
  if (!state.zeroed.contains(feed) || !state.zeroed.contains(profile.powder.build_axis[0])) {
    return wrong("G92 has to set the positions of the pistons");
  }
  if (std::hypot(state.at[x] - profile.motion.safe_mm[0], state.at[y] - profile.motion.safe_mm[1]) > 1e-3) {
    return wrong(fmt::format("the gantry is left at {:g}, {:g} mm, not where layers begin", state.at[x], state.at[y]));
  }
  return {};
}

/// fab/brundle.py: homed, lifted by 2 mm, filled by a person, the recoater at the feed bin.
Status start_of_brundlefab(const VirtualMachine& machine, std::string_view text) {
  GcodeState state;
  bool homed = false, filled = false;
  std::string tool;
  auto lines = lines_of(text);
  if (!lines) return lines.error();
  for (const ProgramLine& line : *lines) {
    if (line.command == "G28") {
      if (line.has('X') && line.has('E')) homed = true;
      for (const auto& [letter, value] : line.word) state.at[letter] = 0;
    } else if (line.command == "M0") {
      filled = homed && state.at['E'] == 2;
    } else if (line.command[0] == 'T') {
      tool = line.command;
    } else if (line.command != "G10" && line.command != "M117" && !take(line, state)) {
      return wrong(fmt::format("line {}: '{}' is no command of a program's begin", line.number, line.command));
    }
    if (!homed && (line.command == "G0" || line.command == "G1")) {
      return wrong(fmt::format("line {}: moves before G28 has homed X and E", line.number));
    }
  }
  if (Status status = check_modes(state); !status) return status;
  if (!homed) return wrong("G28 is missing, which homes X and E");
  if (state.at['E'] != 2)
    return wrong(fmt::format("the feed bin is left at {:g} mm, from where it cannot move down by 2 mm", state.at['E']));
  if (!filled) return wrong("no M0 waits for the feed bin to be filled");
  const double home = machine.profile().powder.roller_mm[0];
  if (tool != "T21" || std::abs(state.at['X'] - home) > 1e-3) {
    return wrong(fmt::format("{} is left at {:g} mm, and layers begin with T21 at {:g}", tool, state.at['X'], home));
  }
  return {};
}

/// Of the four bytes from `at` on, the lowest first.
std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i) number |= std::uint32_t{static_cast<std::uint8_t>(bytes[at + i])} << (8 * i);
  return number;
}

/// Of raw and planes: numbers of four bytes.
Status start_of_bytes(const VirtualMachine& machine, std::string_view text) {
  const bool raw = machine.profile().dialect == "raw";
  const VirtualMachine::Counts want = machine.counts();
  const std::uint32_t grey = want.drop_bits > 1 ? 1 : 0, per_word = raw ? 128 : 32;
  std::vector<std::uint32_t> numbers;
  if (raw) {
    numbers = {0x5741524C};  // LRAW
  } else {
    numbers = {0x4C04, 7 + grey};
  }
  numbers.insert(numbers.end(), {1 + grey, machine.layers(), want.nozzles, want.positions, want.lines, want.steps,
                                 (want.nozzles + per_word - 1) / per_word});
  if (grey != 0) numbers.push_back(want.drop_bits);
  const std::size_t layers = raw ? 2 : 3;
  if (text.size() != numbers.size() * 4)
    return wrong(fmt::format("has {} bytes where {} have to be", text.size(), numbers.size() * 4));
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::uint32_t said = number_at(text, i * 4);
    if (said == numbers[i] || (i == layers && machine.layers() == 0)) continue;
    return wrong(fmt::format("byte {}: says {} where {} has to be", i * 4, said, numbers[i]));
  }
  return {};
}

}  // namespace

Status check_start(const VirtualMachine& machine, std::string_view text) {
  const std::string& dialect = machine.profile().dialect;
  if (dialect == "raw" || dialect == "planes") return start_of_bytes(machine, text);
  return dialect == "brundlefab" ? start_of_brundlefab(machine, text) : start_of_gcode(machine, text);
}

Status check_end(const VirtualMachine& machine, std::string_view text) {
  const std::string& dialect = machine.profile().dialect;
  if (dialect == "raw") return text == "DONE" ? Status() : wrong("is not DONE");
  if (dialect == "planes") {
    const bool ends = text.size() == 8 && number_at(text, 0) == 0x4C05 && number_at(text, 4) == 0;
    return ends ? Status() : wrong("is not the command 0x4C05");
  }
  constexpr std::pair<std::string_view, std::string_view> kCommands[] = {
      {"nuferbj", "M814"}, {"hp45", "BCL"}, {"oasis", "BCL G1"}, {"m578", "M400 M0"}, {"brundlefab", "T0 M117"}};
  const auto own = std::ranges::find(kCommands, dialect, &std::pair<std::string_view, std::string_view>::first);
  auto lines = lines_of(text);
  if (!lines) return lines.error();
  for (const ProgramLine& line : *lines) {
    if (own != std::end(kCommands) &&
        fmt::format(" {} ", own->second).find(fmt::format(" {} ", line.command)) != std::string::npos)
      continue;
    return wrong(fmt::format("line {}: '{}' is no command of a program's end", line.number, line.command));
  }
  if (dialect == "nuferbj" && lines->empty()) return wrong("M814 is missing");
  return {};
}

}  // namespace lamina::replay
