// tests/segment/gcode_reader.h: a strict reader of G-code, written against the documentation of Marlin and Klipper and
// not against our writer: unknown words and letters are errors.
#pragma once

#include <cmath>
#include <cstdlib>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace lamina::test {

struct GcodeBead {
  double x0, y0, x1, y1, z, filament, feed, width, height;
  std::string type;
};

struct GcodeLayer {
  double z = 0, height = 0;
  std::vector<GcodeBead> beads;
};

struct GcodeFile {
  std::string error;
  std::vector<GcodeLayer> layers;
  std::vector<GcodeBead> skirt;  // next to the parts; in no layer
  double drawn_back = 0, widest_retraction = 0;
  double lo_x = 1e9, lo_y = 1e9, hi_x = -1e9, hi_y = -1e9, hi_z = 0;  // of all moves within layers
  std::uint64_t lines = 0;
};

inline GcodeFile read_gcode(const std::string& text) {
  GcodeFile file;
  double x = 0, y = 0, z = 0, e = 0, feed = 0, width = 0;
  std::string type;
  bool relative = false;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    ++file.lines;
    const auto wrong = [&](const std::string& what) {
      if (file.error.empty()) file.error = "line " + std::to_string(file.lines) + ": " + what + ": " + line;
    };
    if (line.rfind(";LAYER_CHANGE", 0) == 0) file.layers.emplace_back();
    if (line.rfind(";Z:", 0) == 0 && !file.layers.empty()) file.layers.back().z = std::stod(line.substr(3));
    if (line.rfind(";HEIGHT:", 0) == 0 && !file.layers.empty()) file.layers.back().height = std::stod(line.substr(8));
    if (line.rfind(";TYPE:", 0) == 0) type = line.substr(6);
    if (line.rfind(";WIDTH:", 0) == 0) width = std::stod(line.substr(7));
    const std::string code = line.substr(0, line.find(';'));
    std::istringstream words(code);
    std::string command;
    if (!(words >> command)) continue;
    static const std::set<std::string> kKnown = {
        "G0",   "G1",   "G20",  "G21",  "G28",  "G90",  "G92",  "M82",  "M83",  "M84",
        "M104", "M106", "M107", "M109", "M140", "M190", "M204", "M572", "M900", "SET_PRESSURE_ADVANCE"};
    if (kKnown.count(command) == 0) wrong("unknown command");
    if (command == "SET_PRESSURE_ADVANCE") continue;
    double at[5] = {x, y, z, e, feed};
    bool given[5] = {};
    for (std::string word; words >> word;) {
      char* end = nullptr;
      const double value = std::strtod(word.c_str() + 1, &end);
      const std::string letters = "XYZEF";
      const auto position = letters.find(word[0]);
      if (word.size() > 1 && *end != 0) wrong("not a number: " + word);
      if (word.size() > 1 && word.find_first_not_of("0123456789.-", 1) != std::string::npos)
        wrong("not a plain decimal: " + word);
      if ((command == "G0" || command == "G1" || command == "G92")) {
        if (position == std::string::npos || word.size() < 2) {
          wrong("unknown letter");
          continue;
        }
        at[position] = value;
        given[position] = true;
      }
    }
    if (command == "M83") relative = true;
    if (command == "M82") relative = false;
    if (command == "G92") {
      if (given[3]) e = at[3];
      continue;
    }
    if (command != "G0" && command != "G1") continue;
    if (given[4] && at[4] <= 0) wrong("no speed");
    feed = at[4];
    const double fed = !given[3] ? 0 : relative ? at[3] : at[3] - e;
    if (given[3]) e = at[3];
    const bool moves = at[0] != x || at[1] != y || given[0] || given[1];
    if (fed != 0 && !moves) {
      file.drawn_back -= fed;
      file.widest_retraction = std::max(file.widest_retraction, file.drawn_back);
      if (file.drawn_back < -1e-6 && !file.layers.empty()) wrong("more filament pushed forth than was drawn back");
    }
    if (moves && !file.layers.empty()) {
      if (given[3]) {
        if (fed < 0) wrong("a bead that draws filament back");
        if (file.drawn_back > 1e-9) wrong("a bead with the filament drawn back");
        if (feed <= 0) wrong("a bead before any speed");
        auto& beads = type.rfind("Skirt", 0) == 0 ? file.skirt : file.layers.back().beads;
        beads.push_back({x, y, at[0], at[1], at[2], fed, feed, width, file.layers.back().height, type});
      }
      for (const auto& [px, py] : {std::pair{at[0], at[1]}}) {
        file.lo_x = std::min(file.lo_x, px);
        file.lo_y = std::min(file.lo_y, py);
        file.hi_x = std::max(file.hi_x, px);
        file.hi_y = std::max(file.hi_y, py);
      }
    }
    file.hi_z = std::max(file.hi_z, at[2]);
    x = at[0];
    y = at[1];
    z = at[2];
  }
  return file;
}

}  // namespace lamina::test
