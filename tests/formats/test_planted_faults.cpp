// Faults that are planted into files of lamina extrude, and the line at which the replay finds each.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <vector>

#include "stages/formats/gcode/replay/defect_text.h"
#include "stages/formats/gcode/replay/replay.h"
#include "tests/commands/program.h"

namespace lamina::formats::gcode {
namespace {

using Lines = std::vector<std::string>;

/// A file that is changed line by line. Layers and lines count from 0; results of changes are lines from 1.
class Planting {
 public:
  explicit Planting(const std::string& text) {
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      lines.push_back(text.substr(at, end - at));
      at = end + 1;
    }
  }
  std::string text() const {
    std::string all;
    for (const std::string& line : lines) all += line + "\n";
    return all;
  }
  /// The tag of a layer; of the one after the last, the end.
  std::size_t layer(int index) const {
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (lines[i] == ";LAYER_CHANGE" && index-- == 0) return i;
    }
    return lines.size();
  }
  /// The nth line of a layer that begins so.
  std::size_t in(int index, const std::string& prefix, int nth = 0) const {
    for (std::size_t i = layer(index); i < lines.size(); ++i) {
      if (lines[i].starts_with(prefix) && nth-- == 0) return i;
    }
    ADD_FAILURE() << prefix;
    return 0;
  }
  /// The nth bead of a layer.
  std::size_t bead(int index, int nth) const {
    for (std::size_t i = layer(index); i < lines.size(); ++i) {
      if (is_bead(lines[i]) && nth-- == 0) return i;
    }
    return 0;
  }
  static bool is_bead(const std::string& line) { return line.starts_with("G1 X") && line.find(" E") != std::string::npos; }
  std::size_t insert(std::size_t at, const std::string& line) {
    lines.insert(lines.begin() + static_cast<std::ptrdiff_t>(at), line);
    return at + 1;
  }
  std::size_t replace(std::size_t at, const std::string& from, const std::string& to) {
    const std::size_t found = lines[at].find(from);
    EXPECT_NE(found, std::string::npos) << lines[at] << " " << from;
    if (found != std::string::npos) lines[at].replace(found, from.size(), to);
    return at + 1;
  }
  void erase(std::size_t first, std::size_t last) {
    lines.erase(lines.begin() + static_cast<std::ptrdiff_t>(first), lines.begin() + static_cast<std::ptrdiff_t>(last));
  }
  std::size_t erase(std::size_t at) {
    erase(at, at + 1);
    return at + 1;
  }
  /// The value of a word, and another one in its stead.
  static double word(const std::string& line, char letter) {
    return std::stod(line.substr(line.find(std::string(" ") + letter) + 2));
  }
  std::size_t scale(std::size_t at, char letter, double factor) {
    std::string& line = lines[at];
    const std::size_t begin = line.find(std::string(" ") + letter) + 2;
    const double value = std::stod(line.substr(begin)) * factor;
    line.replace(begin, std::min(line.find(' ', begin), line.size()) - begin, std::to_string(value));
    return at + 1;
  }
  /// The first line at or after this one that deposits.
  std::size_t next_bead(std::size_t at) const {
    while (!is_bead(lines[at])) ++at;
    return at;
  }

  Lines lines;
};

struct Planted {
  const char* name;
  bool absolute;  // E of the file
  Defect kind;
  std::function<std::size_t(Planting&)> plant;  // returns the line of the fault
};

const std::vector<Planted>& planted_faults();

class PlantedFaults : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new test::Directory;
    test::write_one_of_each_kind(*folder_);
    for (const bool absolute : {false, true}) {
      const std::string name = absolute ? "absolute.gcode" : "relative.gcode";
      const auto made = test::run_lamina({"extrude", "part.stl", "--layer", "0.2", "--density", "30", "--relative-extrusion",
                                          absolute ? "false" : "true", "-o", name},
                                         folder_->path());
      ASSERT_EQ(made.code, 0) << made.err;
      text_[absolute] = test::read_text(folder_->path() / name);
    }
  }
  static void TearDownTestSuite() { delete folder_; }

  static ReplayReport replay(const std::string& text) {
    static Extruder machine;
    machine.max_nozzle_degc = 260;
    machine.max_bed_degc = 100;
    machine.name = "Marlin";
    machine.material.max_melt_mm3_s = 8;
    machine.speed = {.print_mm_s = 60, .travel_mm_s = 150};
    test::write_text(folder_->path() / "planted.gcode", text);
    const auto report = replay_gcode((*folder_) / "planted.gcode", {&machine, 0});
    EXPECT_TRUE(report) << (report ? "" : report.error().message);
    return report ? *report : ReplayReport();
  }

  static inline test::Directory* folder_ = nullptr;
  static inline std::string text_[2];
};

TEST_F(PlantedFaults, FilesAsWrittenHaveNone) {
  for (const std::string& text : text_) {
    const ReplayReport report = replay(text);
    for (std::size_t k = 0; k < kDefects; ++k) {
      const auto kind = static_cast<Defect>(k);
      EXPECT_EQ(report.defects[kind].count, 0u) << defect_text(kind, report.defects[kind]);
    }
    EXPECT_NEAR(report.totals.seconds, report.totals.stated_seconds, 0.01 * report.totals.stated_seconds + 0.5);
    EXPECT_NEAR(report.totals.filament_mm, report.totals.stated_filament_mm, 0.01);
  }
}

TEST_F(PlantedFaults, EachIsFoundAtItsLine) {
  EXPECT_GE(planted_faults().size(), 40u);
  for (const Planted& fault : planted_faults()) {
    SCOPED_TRACE(fault.name);
    Planting planting(text_[fault.absolute]);
    const std::size_t line = fault.plant(planting);
    const ReplayReport report = replay(planting.text());
    const DefectCount& of = report.defects[fault.kind];
    EXPECT_GT(of.count, 0u) << "not found";
    EXPECT_TRUE(line == 0 || of.first.line == line) << of.first.line << " instead of " << line;  // 0: depends on the part
    if (of.count > 0 && (line == 0 || of.first.line == line)) continue;
    for (std::size_t k = 0; k < kDefects; ++k) {
      const auto kind = static_cast<Defect>(k);
      if (report.defects[kind].count > 0) ADD_FAILURE() << fault.name << ": " << defect_text(kind, report.defects[kind]);
    }
  }
}

std::size_t line_of(const Planting& p, const std::string& prefix) {
  for (std::size_t i = 0; i < p.lines.size(); ++i) {
    if (p.lines[i].starts_with(prefix)) return i;
  }
  return 0;
}

/// Layers [first, last) are gone; the line of the first bead of what follows.
std::size_t drop_layers(Planting& p, int first, int last) {
  p.erase(p.layer(first), p.layer(last));
  return p.next_bead(p.layer(first)) + 1;
}

/// The nth path of a layer from its travel to the one of the next path.
std::pair<std::size_t, std::size_t> path_of(const Planting& p, int layer, int nth) {
  return {p.in(layer, "G0 X", nth), p.in(layer, "G0 X", nth + 1)};
}

/// A travel within a layer with the filament drawn back.
std::size_t long_travel(const Planting& p, int layer) {
  std::size_t at = p.in(layer, "G0 X", 1);
  while (!p.lines[at].starts_with("G0 X") || !p.lines[at - 1].starts_with("G1 E")) ++at;
  return at;
}

const std::vector<Planted>& heat_faults() {
  static const std::vector<Planted> faults = {
      {"no heat at all", false, Defect::kCold,
       [](Planting& p) {
         std::erase_if(p.lines, [](const std::string& line) { return line.starts_with("M104") || line.starts_with("M109"); });
         return p.next_bead(0) + 1;
       }},
      {"too cold from the start", false, Defect::kCold,
       [](Planting& p) {
         for (std::string& line : p.lines) {
           if (line.starts_with("M104 S2") || line.starts_with("M109 S2")) line = "M109 S150";
         }
         return p.next_bead(0) + 1;
       }},
      {"heater off in the middle", false, Defect::kCold,
       [](Planting& p) { return p.next_bead(p.insert(p.bead(5, 3), "M104 S0")) + 1; }},
      {"heater off, absolute", true, Defect::kCold,
       [](Planting& p) { return p.next_bead(p.insert(p.layer(7), "M109 R100")) + 1; }},
      {"nozzle too hot", false, Defect::kNozzleHot, [](Planting& p) { return p.insert(p.layer(2), "M104 S300"); }},
      {"nozzle too hot at the start", false, Defect::kNozzleHot,
       [](Planting& p) { return p.replace(line_of(p, "M109"), "S210", "S2100"); }},
      {"bed too hot", false, Defect::kBedHot, [](Planting& p) { return p.insert(p.layer(2), "M140 S160"); }},
      {"bed too hot at the start", true, Defect::kBedHot,
       [](Planting& p) { return p.replace(line_of(p, "M190"), "S60", "S600"); }},
  };
  return faults;
}

const std::vector<Planted>& filament_faults() {
  static const std::vector<Planted> faults = {
      {"lost E reset", true, Defect::kLostReset,
       [](Planting& p) {
         p.erase(p.in(3, "G92 E0"));
         return p.in(3, "G1 E") + 1;
       }},
      {"lost E reset of the second layer", true, Defect::kLostReset,
       [](Planting& p) {
         p.erase(p.in(1, "G92 E0"));
         return p.in(1, "G1 E") + 1;
       }},
      {"E set to 0 within a layer", true, Defect::kThickBead,
       [](Planting& p) { return p.insert(p.bead(4, 20), "G92 E0") + 1; }},
      {"lost retraction", false, Defect::kOverfed,
       [](Planting& p) {
         p.erase(p.in(4, "G1 E-"));
         return p.in(4, "G1 E1 ", 1) + 1;
       }},
      {"E set to 0 before a travel", true, Defect::kOverfed,
       [](Planting& p) {
         std::size_t at = p.insert(long_travel(p, 4), "G92 E0");
         while (!p.lines[at].starts_with("G1 E")) ++at;
         return at + 1;
       }},
      {"filament not fed again", false, Defect::kNotFedBack,
       [](Planting& p) {
         const std::size_t at = p.in(4, "G1 E1 ", 1);
         p.erase(at);
         return p.next_bead(at) + 1;
       }},
      {"filament drawn back twice", false, Defect::kNotFedBack,
       [](Planting& p) {
         const std::size_t at = p.in(6, "G1 E-");
         p.insert(at, p.lines[at]);
         return p.next_bead(at) + 1;
       }},
      {"three times the filament fed again", false, Defect::kOverfed,
       [](Planting& p) { return p.replace(p.in(6, "G1 E1 "), "E1 ", "E3 "); }},
      {"relative E read as absolute", false, Defect::kFeedsNothing,
       [](Planting& p) {
         for (std::string& line : p.lines) {
           if (line.starts_with("M83")) line = "M82";
         }
         return std::size_t{0};
       }},
      {"absolute E read as relative", true, Defect::kThickBead,
       [](Planting& p) {
         p.insert(p.layer(2), "M83");
         return std::size_t{0};
       }},
      {"half of the filament in a bead", false, Defect::kThinBead, [](Planting& p) { return p.scale(p.bead(5, 1), 'E', 0.5); }},
      {"twice the filament in a bead", false, Defect::kThickBead, [](Planting& p) { return p.scale(p.bead(5, 1), 'E', 2); }},
      {"a hundred times the filament", false, Defect::kThickBead, [](Planting& p) { return p.scale(p.bead(8, 2), 'E', 100); }},
      {"half of the flow in a layer", false, Defect::kNotFedBack,
       [](Planting& p) {
         p.insert(p.layer(6), "M221 S100");
         p.insert(p.layer(5), "M221 S50");
         return p.next_bead(p.layer(5)) + 1;
       }},
      {"a bead deposited on the spot once more", false, Defect::kOverfed,
       [](Planting& p) {
         const std::size_t at = p.bead(5, 1);
         return p.insert(at, p.lines[at]) + 1;
       }},
  };
  return faults;
}

const std::vector<Planted>& layer_faults() {
  static const std::vector<Planted> faults = {
      {"skipped layer", false, Defect::kSkippedLayer, [](Planting& p) { return drop_layers(p, 4, 5); }},
      {"three skipped layers", true, Defect::kSkippedLayer, [](Planting& p) { return drop_layers(p, 7, 10); }},
      {"layers swapped", false, Defect::kLayerOrder,
       [](Planting& p) {
         const auto at = [&](int layer) { return p.lines.begin() + static_cast<std::ptrdiff_t>(p.layer(layer)); };
         std::rotate(at(4), at(5), at(6));
         return p.next_bead(p.layer(5)) + 1;
       }},
      {"a layer ten times as high", false, Defect::kSkippedLayer,
       [](Planting& p) {
         p.scale(p.in(4, "G1 Z"), 'Z', 10);
         return p.next_bead(p.layer(4)) + 1;
       }},
      {"a layer deposited twice", false, Defect::kDoubledBead,
       [](Planting& p) {
         const Lines copy(p.lines.begin() + static_cast<std::ptrdiff_t>(p.layer(4)),
                          p.lines.begin() + static_cast<std::ptrdiff_t>(p.layer(5)));
         p.lines.insert(p.lines.begin() + static_cast<std::ptrdiff_t>(p.layer(5)), copy.begin(), copy.end());
         return p.next_bead(p.layer(5)) + 1;
       }},
      {"a layer without beads", false, Defect::kEmptyLayer,
       [](Planting& p) {
         p.erase(p.layer(4) + 3, p.layer(5));
         return p.layer(4) + 1;
       }},
      {"z without its return", false, Defect::kBeadHeight,
       [](Planting& p) { return p.next_bead(p.insert(p.bead(4, 6), "G1 Z5 F600")) + 1; }},
      {"z below the bed", false, Defect::kBelowBed,
       [](Planting& p) {
         p.replace(p.in(0, "G1 Z"), "Z", "Z-");
         return p.next_bead(p.layer(0)) + 1;
       }},
  };
  return faults;
}

const std::vector<Planted>& path_faults() {
  static const std::vector<Planted> faults = {
      {"missing outer walls", false, Defect::kNoWall,
       [](Planting& p) {
         const std::size_t first = p.in(5, ";TYPE:External perimeter"), end = p.in(5, ";TYPE:Perimeter");
         std::size_t last = end;
         while (!p.lines[last].starts_with("G0 X")) --last;  // to the inner wall
         p.erase(first, last);
         return p.next_bead(p.layer(5)) + 1;
       }},
      {"missing bead of a wall", false, Defect::kThinBead,
       [](Planting& p) {
         p.erase(p.bead(5, 1));
         return p.bead(5, 1) + 1;
       }},
      {"gap of one bead", false, Defect::kOpenWall,
       [](Planting& p) {
         const std::size_t at = p.bead(5, 1);
         p.lines[at] = p.lines[at].substr(0, p.lines[at].find(" E"));
         return p.bead(5, 0) + 1;
       }},
      {"gap at the end of a wall", false, Defect::kOpenWall,
       [](Planting& p) {
         std::size_t at = path_of(p, 5, 0).second;
         while (!Planting::is_bead(p.lines[at])) --at;
         p.erase(at);
         return p.bead(5, 0) + 1;
       }},
      {"doubled wall", false, Defect::kDoubledBead,
       [](Planting& p) {
         const auto [first, last] = path_of(p, 5, 0);
         const Lines copy(p.lines.begin() + static_cast<std::ptrdiff_t>(first),
                          p.lines.begin() + static_cast<std::ptrdiff_t>(last));
         p.lines.insert(p.lines.begin() + static_cast<std::ptrdiff_t>(last), copy.begin(), copy.end());
         return p.next_bead(last) + 1;
       }},
      {"doubled line of the filling", true, Defect::kDoubledBead,
       [](Planting& p) {
         const std::size_t at = p.in(5, ";TYPE:Internal infill"), bead = p.next_bead(at);
         std::size_t travel = at;
         while (!p.lines[travel].starts_with("G0 X")) --travel;
         const double e = Planting::word(p.lines[bead], 'E');
         std::string start = p.lines[travel], again = p.lines[bead];
         p.insert(bead + 1, "G92 E0");
         p.insert(bead + 2, start);
         p.insert(bead + 3, again.substr(0, again.find(" E")) + " E0.3 F1800");
         p.insert(bead + 4, "G92 E" + std::to_string(e));
         return bead + 4;
       }},
      {"beyond the right of the bed", false, Defect::kOffBed, [](Planting& p) { return p.scale(p.bead(3, 2), 'X', 3); }},
      {"beyond the front of the bed", false, Defect::kOffBed, [](Planting& p) { return p.replace(p.bead(3, 2), "Y", "Y-"); }},
      {"above the build height", false, Defect::kTooHigh,
       [](Planting& p) {
         p.lines[p.in(6, "G1 Z")] = "G1 Z300 F600";
         return p.next_bead(p.layer(6)) + 1;
       }},
      {"relative positions", false, Defect::kOffBed,
       [](Planting& p) {
         p.insert(p.bead(3, 2), "G91");
         return std::size_t{0};
       }},
      {"bead above the feed limit", false, Defect::kTooFast,
       [](Planting& p) {
         const std::size_t at = p.bead(3, 2);
         p.lines[at] += " F30000";
         return at + 1;
       }},
      {"travel above the feed limit", true, Defect::kTooFast,
       [](Planting& p) { return p.replace(long_travel(p, 3), "F9000", "F90000"); }},
      {"melt rate", false, Defect::kMeltRate,
       [](Planting& p) {
         const std::size_t at = p.bead(3, 2);
         p.lines[at] += " F8900";
         return at + 1;
       }},
      {"speed of zero", false, Defect::kNoFeedRate,
       [](Planting& p) {
         const std::size_t at = p.bead(3, 2);
         p.lines[at] += " F0";
         return at + 1;
       }},
      {"no speed in the file", false, Defect::kNoFeedRate,
       [](Planting& p) {
         for (std::string& line : p.lines) line = line.substr(0, std::min(line.find(" F"), line.size()));
         return p.next_bead(0) + 1;
       }},
      {"a file that is cut off", false, Defect::kTruncated,
       [](Planting& p) {
         p.erase(p.bead(8, 3), p.lines.size());
         return p.lines.size();
       }},
      {"missing path of the filling", false, Defect::kStatedFilament,
       [](Planting& p) {
         std::size_t at = p.next_bead(p.in(6, ";TYPE:Internal infill"));
         while (Planting::is_bead(p.lines[at])) p.erase(at);
         return p.lines.size();
       }},
      {"all beads at a tenth of their speed", false, Defect::kStatedTime,
       [](Planting& p) {
         for (std::size_t i = 0; i < p.lines.size(); ++i) {
           if (Planting::is_bead(p.lines[i]) && p.lines[i].find(" F") != std::string::npos) p.scale(i, 'F', 0.1);
         }
         return p.lines.size();
       }},
      {"a number that is none", false, Defect::kUnreadable, [](Planting& p) { return p.replace(p.bead(3, 2), ".", ","); }},
      {"inches", false, Defect::kUnreadable,
       [](Planting& p) {
         p.insert(p.layer(3), "G20");
         return std::size_t{0};
       }},
  };
  return faults;
}

const std::vector<Planted>& planted_faults() {
  static const std::vector<Planted> all = [] {
    std::vector<Planted> list;
    for (const auto* some : {&heat_faults(), &filament_faults(), &layer_faults(), &path_faults()})
      list.insert(list.end(), some->begin(), some->end());
    return list;
  }();
  return all;
}

}  // namespace
}  // namespace lamina::formats::gcode
