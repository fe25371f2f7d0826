#include "stages/formats/gcode/slow_layer.h"

#include <algorithm>

#include "stages/support/text/decimal.h"

namespace lamina::formats::gcode {
namespace {

constexpr int kTrials = 6;          // by the time of the trial before; later ones slow down by kStep each
constexpr double kStep = 0.97;      // of the factor
constexpr double kSurplus = 1.001;  // of the minimum time, at which a trial aims

}  // namespace

SlowLayer::SlowLayer(const Extruder& machine, const Layer& layer, std::uint32_t layers, Buffer<char>& out,
                     const Switches& switches, const LayerSurroundings& around)
    : machine_(machine), layer_(layer), layers_(layers), out_(out), switches_(switches), around_(around) {}

bool SlowLayer::keeps_speed(const BeadMove& move) const {
  return around_.segmented &&
         (move.kind == PathKind::kRaster || move.kind == PathKind::kContour || move.kind == PathKind::kLink);
}

double SlowLayer::slowed(double speed, double factor) const {
  return std::min(speed, std::max(machine_.fan.min_print_mm_s, speed * factor));
}

double SlowLayer::bead_seconds(double factor) const {
  double seconds = 0;
  for (const SpeedLength& of : lengths_) seconds += of.length / (of.keeps ? of.speed : slowed(of.speed, factor));
  return seconds;
}

/// The factor with which beads alone take so long, or 0.
double SlowLayer::factor_for(double seconds) const {
  double low = 0, high = 1;
  for (int i = 0; i < 40; ++i) {
    const double middle = (low + high) / 2;
    (bead_seconds(middle) >= seconds ? low : high) = middle;
  }
  return low;
}

void SlowLayer::replay(LayerWriter& writer, double factor) const {
  std::size_t next = 0;
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    for (; next < object_.size() && object_[next].first == i; ++next) writer.begin_object(object_[next].second);
    BeadMove move = waiting_[i];
    if (!keeps_speed(move)) move.speed_mm_s = slowed(move.speed_mm_s, factor);
    writer.deposit(move);
  }
  for (; next < object_.size(); ++next) writer.begin_object(object_[next].second);
}

double SlowLayer::deposit(const BeadMove& move) {
  if (writer_) return writer_->deposit(move);
  const double length = length_of(move);
  waiting_.push_back(move);
  const bool keeps = keeps_speed(move);
  const auto same =
      std::ranges::find_if(lengths_, [&](const SpeedLength& of) { return of.speed == move.speed_mm_s && of.keeps == keeps; });
  if (same == lengths_.end()) {
    lengths_.push_back({move.speed_mm_s, length, keeps});
  } else {
    same->length += length;
  }
  seconds_ += length / move.speed_mm_s;
  if (seconds_ >= machine_.fan.min_layer_s) {
    writer_.emplace(machine_, layer_, layers_, out_, switches_, around_);
    replay(*writer_, 1);
    waiting_ = {};
  }
  return length;
}

void SlowLayer::begin_object(std::uint32_t object) {
  if (writer_) return writer_->begin_object(object);
  object_.emplace_back(waiting_.size(), object);
}

const MoveTotals& SlowLayer::finish() {
  if (writer_) return writer_->finish();
  const double minimum = machine_.fan.min_layer_s;
  double highest = 0;
  for (const SpeedLength& of : lengths_) highest = std::max(highest, of.keeps ? 0 : of.speed);
  const double lowest = std::min(1.0, machine_.fan.min_print_mm_s / std::max(highest, 1e-9));  // all beads are at their limit
  Buffer<char> text;
  double factor = 1;
  for (int trial = 0;; ++trial) {
    text.clear();
    LayerWriter writer(machine_, layer_, layers_, text, switches_, around_);
    replay(writer, factor);
    totals_ = writer.finish();
    if (totals_.seconds >= minimum || factor <= lowest) break;
    const double others = totals_.seconds - bead_seconds(factor);
    factor = std::max(lowest, trial < kTrials ? std::min(factor, factor_for(minimum * kSurplus - others)) : factor * kStep);
  }
  append(out_, std::string_view(text.data(), text.size()));
  return totals_;
}

}  // namespace lamina::formats::gcode
