// tests/bead/neighbours.cpp: groups of beads that touch; the room between their centres is shared by all of a group.
#include "tests/bead/neighbours.h"

#include <algorithm>
#include <cstddef>

namespace lamina::bead {
namespace {

class Squeeze {
 public:
  Squeeze(std::span<const AdjacentBead> beads, double height, double period, Buffer<SqueezedBead>& out)
      : beads_(beads), out_(out), height_(height), period_(period), size_(beads.size()) {
    out_.resize(size_);
    for (std::size_t i = 0; i < size_; ++i) {
      const auto& [centre, area, width] = beads_[i];
      out_[i] = {centre - width / 2, centre + width / 2, false, 0, height};
    }
  }

  void run() {
    // A group that was pushed outwards may reach one more bead.
    while (join()) {
      std::size_t begin = 0;
      if (period_ > 0) {
        while (begin < size_ && out_[(begin + size_ - 1) % size_].touches_right) ++begin;
        if (begin == size_) return fill_endless();
      }
      for (std::size_t first = begin; first < begin + size_;) {
        std::size_t last = first;
        while (out_[last % size_].touches_right) ++last;
        if (last > first) fill(first, last);
        first = last + 1;
      }
    }
  }

 private:
  bool has_right(std::size_t i) const { return i % size_ + 1 < size_ || period_ > 0; }
  const AdjacentBead& bead(std::size_t i) const { return beads_[i % size_]; }
  double turns(std::size_t i) const { return i < size_ ? 0 : period_; }
  double distance(std::size_t i) const { return bead(i + 1).centre_mm + turns(i % size_ + 1) - bead(i).centre_mm; }
  /// Room that stays between the centres of a bead and its right neighbour; below 0: more than all.
  double clearance(std::size_t i) const { return height_ * distance(i) - (bead(i).area_mm2 + bead(i + 1).area_mm2) / 2; }

  bool join() {
    bool joined = false;
    for (std::size_t i = 0; i < size_; ++i) {
      if (out_[i].touches_right || !has_right(i)) continue;
      const std::size_t next = (i + 1) % size_;
      if (out_[i].right_mm < out_[next].left_mm + turns(i + 1)) continue;
      out_[i].touches_right = joined = true;
    }
    return joined;
  }

  void touch(std::size_t i, double filled) {
    SqueezedBead& left = out_[i % size_];
    SqueezedBead& right = out_[(i + 1) % size_];
    // Both give way by the shares of their widths.
    const double widths = bead(i).width_mm + bead(i + 1).width_mm;
    const double position = widths > 0 ? distance(i) * bead(i).width_mm / widths : distance(i) / 2;
    left.right_mm = bead(i).centre_mm + position;
    right.left_mm = left.right_mm - turns(i % size_ + 1);
    left.cusps_mm2 = std::max(clearance(i), 0.0) * (1 - filled);
  }

  /// What has no room between the beads first..last, and what room there is.
  void sum(std::size_t first, std::size_t last, double& over, double& free) const {
    over = free = 0;
    for (std::size_t i = first; i < last; ++i) {
      over += std::max(-clearance(i), 0.0);
      free += std::max(clearance(i), 0.0);
    }
  }

  void fill(std::size_t first, std::size_t last) {
    double over = 0, free = 0;
    sum(first, last, over, free);
    const double filled = over < free ? over / free : 1;
    for (std::size_t i = first; i < last; ++i) touch(i, filled);
    const double pushed = std::max(over - free, 0.0) / (2 * height_);
    SqueezedBead& left = out_[first % size_];
    SqueezedBead& right = out_[last % size_];
    left.left_mm = bead(first).centre_mm - bead(first).width_mm / 2 - pushed;
    right.right_mm = bead(last).centre_mm + bead(last).width_mm / 2 + pushed;
  }

  void fill_endless() {
    double over = 0, free = 0;
    sum(0, size_, over, free);
    const double filled = over < free ? over / free : 1;
    for (std::size_t i = 0; i < size_; ++i) {
      touch(i, filled);
      out_[i].height_mm = height_ + std::max(over - free, 0.0) / period_;
    }
  }

  std::span<const AdjacentBead> beads_;
  Buffer<SqueezedBead>& out_;
  double height_, period_;
  std::size_t size_;
};

}  // namespace

void squeeze(std::span<const AdjacentBead> beads, double height_mm, double period_mm, Buffer<SqueezedBead>& out) {
  if (beads.empty()) return out.clear();
  Squeeze(beads, height_mm, period_mm, out).run();
}

}  // namespace lamina::bead
