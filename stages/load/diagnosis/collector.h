// stages/load/diagnosis/collector.h: counts what is wrong, and keeps the first places of it; internal to load.
#pragma once

#include <algorithm>
#include <compare>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/load/repair/diagnose.h"
#include "stages/load/repair/geometry.h"

namespace lamina::load {

inline Point3 middle(const Point3& p, const Point3& q) {
  const auto half = [](Nm one, Nm other) { return static_cast<Nm>((std::int64_t{one} + other) / 2); };
  return {half(p.x, q.x), half(p.y, q.y), half(p.z, q.z)};
}

/// Counts, and keeps the `places` with the smallest triangles, of one triangle the lowest edges.
class Collector {
 public:
  explicit Collector(std::size_t places) : places_(places) {}

  /// At an edge between two points, or at a point.
  void add(std::uint32_t triangle, const Point3& p, const Point3& q) {
    ++count_;
    keep({triangle, std::min(p, q), std::max(p, q)});
  }
  void add(const Collector& other) {
    count_ += other.count_;
    for (const Found& found : other.first_) keep(found);
  }
  std::uint64_t count() const { return count_; }
  Diagnosis::Finding finding() const {
    Diagnosis::Finding result{count_, {}};
    for (const Found& found : first_) result.first.push_back({found.triangle, middle(found.low, found.high)});
    return result;
  }

 private:
  struct Found {
    std::uint32_t triangle;
    Point3 low, high;
    friend auto operator<=>(const Found&, const Found&) = default;
  };
  void keep(const Found& found) {
    if (first_.size() == places_ && (places_ == 0 || first_.back() <= found)) return;
    if (first_.size() == places_) first_.pop_back();
    first_.insert(std::upper_bound(first_.begin(), first_.end(), found), found);
  }

  std::size_t places_;
  std::uint64_t count_ = 0;
  std::vector<Found> first_;
};

/// Degenerate facets of a list that any number of threads show piece by piece.
class DegenerateFacets {
 public:
  explicit DegenerateFacets(std::size_t places) : places_(places), found_(places) {}

  /// first  the number of the first of these facets
  void look(std::uint32_t first, std::span<const Triangle> facets) {
    Collector here(places_);
    for (std::size_t i = 0; i < facets.size(); ++i)
      if (!has_area(facets[i])) here.add(first + static_cast<std::uint32_t>(i), facets[i].a, facets[i].a);
    if (here.count() == 0) return;
    const std::lock_guard lock(mutex_);
    found_.add(here);
  }
  Diagnosis::Finding finding() const { return found_.finding(); }

 private:
  std::size_t places_;
  Collector found_;
  std::mutex mutex_;
};

}  // namespace lamina::load
