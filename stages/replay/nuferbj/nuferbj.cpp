// stages/program/nuferbj/README.md has the format.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <span>
#include <vector>

#include "stages/replay/gcode.h"

namespace lamina::replay {
namespace {

/// J<step> fired there and, after R<repeats>, at as many steps behind it.
struct ShotVector {
  std::int64_t step = 0;
  std::uint32_t repeats = 0;
};

/// What a swath loads. A program of one line may repeat a vector a hundred million times: they are counted, not written out.
class Loaded {
 public:
  explicit Loaded(std::uint32_t nozzles) : nozzles_(nozzles), words_a_vector_((nozzles + 63) / 64) {}

  /// Words of eight hexadecimal digits, read from left to right as nozzles 0, 1, 2, ... returns  the step
  std::int64_t add(const GcodeLine& line, GcodeReader& reader) {
    ShotVector vector;
    const std::string_view number = line.command.substr(1);
    const auto [stop, error] = std::from_chars(number.data(), number.data() + number.size(), vector.step);
    if (error != std::errc() || stop != number.data() + number.size() || vector.step < -kMaxStep || vector.step > kMaxStep) {
      reader.fault("a vector without a step");
      return 0;
    }
    const std::size_t position = words_.size();
    words_.resize(position + words_a_vector_, 0);
    vectors_.push_back(vector);
    read_words(line.rest, std::span(words_).subspan(position), reader);
    return vector.step;
  }

  /// Repeats the last vector. returns  whether there is one, and a number that can be
  bool repeat(std::string_view number) {
    std::uint32_t repeats = 0;
    const auto [stop, error] = std::from_chars(number.data(), number.data() + number.size(), repeats);
    if (vectors_.empty() || error != std::errc() || stop != number.data() + number.size()) return false;
    if (repeats > kMaxRepeats - vectors_.back().repeats) return false;
    vectors_.back().repeats += repeats;
    return true;
  }

  std::span<const ShotVector> vectors() const { return vectors_; }
  std::span<const std::uint64_t> words(std::size_t vector) const {
    return std::span(words_).subspan(vector * words_a_vector_, words_a_vector_);
  }
  void clear() { vectors_.clear(), words_.clear(); }

 private:
  static constexpr std::uint32_t kMaxRepeats = 100'000'000;
  static constexpr std::int64_t kMaxStep = UINT32_MAX;

  void read_words(std::string_view text, std::span<std::uint64_t> words, GcodeReader& reader) const {
    const std::uint32_t groups = (nozzles_ + 31) / 32;
    if (text.size() != std::size_t{groups} * 9 - 1) {
      reader.fault(fmt::format("a vector of {} characters where {} nozzles have {}", text.size(), nozzles_, groups * 9 - 1));
      return;
    }
    for (std::uint32_t group = 0; group < groups; ++group) {
      const char* digits = text.data() + std::size_t{group} * 9;
      std::uint32_t bits = 0;
      const auto [end, wrong] = std::from_chars(digits, digits + 8, bits, 16);
      if (wrong != std::errc() || end != digits + 8 || (group > 0 && digits[-1] != ' '))
        reader.fault("a word that is no hexadecimal number");
      words[group / 2] |= std::uint64_t{bits} << (group % 2 == 0 ? 32 : 0);
    }
  }

  std::uint32_t nozzles_;
  std::size_t words_a_vector_;
  std::vector<ShotVector> vectors_;
  std::vector<std::uint64_t> words_;
};

/// Whether the head goes the way that the sweep says, and has its ramps before the first step and behind the last.
bool goes_its_way(std::span<const ShotVector> vectors, bool backward, double from, double to, Printing& printing) {
  if (vectors.empty()) return true;
  const bool grows = printing.position_of(1) > printing.position_of(0), up = (to > from) == grows;
  if (up == backward) {
    printing.fault(fmt::format("D{} and the head goes from {:g} to {:g} mm", backward ? 1 : 0, from, to));
    return false;
  }
  const ShotVector& last = vectors.back();
  const double sign = to > from ? 1 : -1, repeats = backward ? -double(last.repeats) : last.repeats;
  const double first_mm = printing.position_of(static_cast<double>(vectors.front().step));
  const double last_mm = printing.position_of(static_cast<double>(last.step) + repeats);
  return printing.has_ramps(sign * (first_mm - from), sign * (to - last_mm));
}

/// Fires what is loaded while the head goes from one place to another, mm.
void fire(const Loaded& loaded, bool backward, double from, double to, Printing& printing) {
  const double low = std::min(from, to), high = std::max(from, to);
  const auto vectors = loaded.vectors();
  for (std::size_t v = 0; v < vectors.size(); ++v) {
    // Of one that fires nothing the first and the last repeat are enough.
    const auto words = loaded.words(v);
    const bool blank = std::ranges::all_of(words, [](std::uint64_t word) { return word == 0; });
    const std::uint32_t stride = blank ? std::max(1u, vectors[v].repeats) : 1;
    for (std::uint64_t k = 0; k <= vectors[v].repeats; k += stride) {
      const std::int64_t step = vectors[v].step + (backward ? -static_cast<std::int64_t>(k) : static_cast<std::int64_t>(k));
      printing.at_step(step);
      const double at = printing.position_of(static_cast<double>(step));
      if (at < low - 1e-3 || at > high + 1e-3) return printing.fault("the head does not come over this step");
      printing.fire_words(words);
      if (!printing.ok()) return;
    }
  }
  goes_its_way(vectors, backward, from, to, printing);
}

/// Carries out what is no drop, powder or movement; false if it is another command.
bool take_maintenance(const GcodeLine& line, GcodeReader& reader, Axes& axes, Printing& printing) {
  const auto& profile = printing.profile();
  if (line.command == "M815") {
    printing.refills();
  } else if (line.command == "M816") {
    const std::uint32_t drops = reader.count(line, 'N');
    printing.spits(axes.at(profile.motion.x_axis), axes.at(profile.motion.y_axis), drops,
                   drops / profile.head.highest_frequency_hz);
  } else if (line.command == "G4") {
    printing.dwells(reader.number(line, 'P') / 1000);
  } else if (line.command == "M4" || line.command == "M5") {
    printing.roller_turns(line.command == "M4" ? reader.number(line, 'S') : 0);
  } else {
    return false;
  }
  return true;
}

}  // namespace

void read_nuferbj(std::string_view text, Printing& printing) {
  GcodeReader reader(text, printing);
  Axes axes(printing, reader);
  GcodeLine line;
  if (!reader.next(line) || line.command != "M811" || reader.count(line, 'L') != printing.layer()) {
    return printing.fault("the program does not begin with M811 of this layer");
  }
  printing.state_layers(reader.count(line, 'T'));
  printing.state_heights({}, reader.number(line, 'H'));
  const ScanAxes scan(printing.profile());
  Loaded loaded(printing.nozzles());  // fired by the next G1 along the scan
  bool in_sweep = false, backward = false, ended = false;
  while (reader.next(line)) {
    if (ended) return reader.fault("continues after M813");
    if (line.command == "M812") {
      if (in_sweep) return reader.fault("a swath begins before the last one was scanned");
      const std::uint32_t direction = reader.count(line, 'D');
      if (direction > 1) return reader.fault("D is 0, or 1 of a sweep that runs back");
      backward = direction == 1;
      printing.begin_sweep(reader.count(line, 'S'), backward, reader.count(line, 'T'));
      in_sweep = true;
    } else if (line.command[0] == 'J') {
      if (!in_sweep) return reader.fault("a vector outside of a swath");
      printing.reading_step(loaded.add(line, reader));
    } else if (line.command[0] == 'R') {
      if (!loaded.repeat(line.command.substr(1))) return reader.fault("R repeats no vector");
    } else if (line.command == "G1" && in_sweep && line.has(scan.along[0])) {
      const double from = axes.at(scan.along), across = axes.at(scan.across);
      printing.go_across(across);
      axes.take(line, true);
      if (axes.at(scan.across) != across) return reader.fault("moves across while it fires");
      fire(loaded, backward, from, axes.at(scan.along), printing);
      if (!printing.ok()) return;
      loaded.clear();
      in_sweep = false;
    } else if (!in_sweep && take_maintenance(line, reader, axes, printing)) {
      if (!printing.ok()) return;
    } else if (line.command == "M813") {
      if (in_sweep || reader.count(line, 'L') != printing.layer()) return reader.fault("the layer ends within a swath");
      axes.end();
      ended = true;
    } else if (!loaded.vectors().empty()) {
      return reader.fault("only the sweep may follow vectors: the head would pass their steps in another move");
    } else if (!axes.take(line, false)) {
      return reader.fault(fmt::format("'{}' is no command of the dialect nuferbj", line.command));
    }
  }
  if (!ended) return printing.fault("the program ends before M813");
}

}  // namespace lamina::replay
