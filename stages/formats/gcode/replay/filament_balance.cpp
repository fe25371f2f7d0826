#include "stages/formats/gcode/replay/filament_balance.h"

#include <algorithm>
#include <cmath>

namespace lamina::formats::gcode {

void FilamentBalance::feed(double mm, bool absolute, FileLine at) {
  if (mm == 0) return;
  if (mm < 0) {
    if (sum_ >= 0) ++retractions_;
    step_ = {-mm, at, absolute};
  } else {
    fed_at_ = at;
  }
  sum_ += mm;
  deepest_ = std::max(deepest_, -sum_);
  open_ = true;
}

void FilamentBalance::forget() {
  open_ = false;
  exempt_ = true;
  sum_ = deepest_ = 0;
  step_ = {};
}

void FilamentBalance::bead(FileLine at) {
  if (!open_) return;
  constexpr double kBin = 0.02;  // mm
  const PauseBalance now{sum_, deepest_, 0, sum_ > 0 ? fed_at_ : at, step_};
  const double balance = sum_;
  const bool exempt = exempt_;
  forget();
  exempt_ = false;
  if (exempt) return;
  const auto same = [&](const PauseBalance& of) { return std::abs(of.mm - balance) <= kBin; };
  auto* found = std::find_if(balances_.data(), balances_.data() + size_, same);
  if (found == balances_.data() + size_) {
    if (size_ == kBalances) {
      found = std::min_element(balances_.data(), balances_.data() + size_, [&](const PauseBalance& a, const PauseBalance& b) {
        return std::abs(a.mm - balance) < std::abs(b.mm - balance);
      });
    } else {
      *found = now;
      ++size_;
    }
  }
  ++found->count;
  found->deepest = std::max(found->deepest, now.deepest);
}

void FilamentBalance::finish(Defects& defects) const {
  const auto* end = balances_.data() + size_;
  const auto* usual =
      std::max_element(balances_.data(), end, [](const PauseBalance& a, const PauseBalance& b) { return a.count < b.count; });
  if (usual == end) return;
  for (const auto* one = balances_.data(); one != end; ++one) {
    const double more = one->mm - usual->mm;
    if (std::abs(more) <= kToleranceMm) continue;
    // An E that goes back by more than retractions do was counted from 0 without G92 E0.
    if (one->last_back.absolute && -one->mm > 1.05 * usual->deepest + kToleranceMm) {
      defects.add(Defect::kLostReset, one->last_back.at, -one->mm, usual->deepest, one->count);
    } else {
      defects.add(more > 0 ? Defect::kOverfed : Defect::kNotFedBack, one->first, std::abs(more), usual->mm, one->count);
    }
  }
}

}  // namespace lamina::formats::gcode
