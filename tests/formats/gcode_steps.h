// tests/formats/gcode_steps.h: the moves of a G-code text one after another, read without the program's own reader.
#pragma once

#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

namespace lamina::test {

struct GcodeStep {
  std::string command, type;
  int layer;
  double x0, y0, z0, x, y, z;
  double fed;     // mm of filament, negative: drawn back
  double back;    // drawn back in all, after the step
  double feed;    // mm/min
  bool over_bed;  // has an X or Y: beads shorter than a micrometre end where they begin
  bool moves() const { return over_bed; }
};

/// The moves of the layers and, in `back_at_layer`, the filament that is drawn back at the start of each and at the end.
struct GcodeSteps {
  std::vector<GcodeStep> steps;
  std::vector<double> back_at_layer;
};

inline GcodeSteps read_steps(const std::string& text) {
  GcodeSteps read;
  GcodeStep at{};
  at.layer = -1;
  double e = 0;
  bool relative = true;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (line == ";LAYER_CHANGE") {
      ++at.layer;
      read.back_at_layer.push_back(at.back);
    }
    if (line.rfind(";TYPE:", 0) == 0) at.type = line.substr(6);
    if (line.rfind("; filament used", 0) == 0) break;
    std::istringstream words(line.substr(0, line.find(';')));
    if (!(words >> at.command)) continue;
    if (at.command == "M83") relative = true;
    if (at.command == "M82") relative = false;
    if (at.command != "G0" && at.command != "G1" && at.command != "G92") continue;
    at.x0 = at.x, at.y0 = at.y, at.z0 = at.z, at.fed = 0, at.over_bed = false;
    for (std::string word; words >> word;) {
      const double value = std::strtod(word.c_str() + 1, nullptr);
      at.over_bed |= word[0] == 'X' || word[0] == 'Y';
      if (word[0] == 'X') at.x = value;
      if (word[0] == 'Y') at.y = value;
      if (word[0] == 'Z') at.z = value;
      if (word[0] == 'F') at.feed = value;
      if (word[0] == 'E' && at.command != "G92") at.fed = relative ? value : value - e;
      if (word[0] == 'E') e = value;
    }
    if (at.command == "G92") continue;
    // A bead feeds while nothing is drawn back; all else takes back or gives again.
    if (at.fed < 0 || (at.fed > 0 && !at.moves())) at.back -= at.fed;
    if (at.layer >= 0) read.steps.push_back(at);
  }
  read.back_at_layer.push_back(at.back);
  return read;
}

}  // namespace lamina::test
