// tests/pipeline/plan/test_skins.cpp: tops and bottoms of parts of low density are solid, by areas that do not know how they
// are made: sections of the part without a filling, and the beads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/job/file.h"
#include "tests/commands/program.h"
#include "tests/pipeline/plan/plan_of.h"

namespace lamina::test {
namespace {

using namespace pipeline;

const std::string kCorpus = std::string(LAMINA_TEST_DIR) + "/corpus/";

/// Cells of a square grid over a bed.
class CellGrid {
 public:
  CellGrid(const Box& box, Nm cell)
      : cell_(cell), low_{box.lo.x, box.lo.y}, columns_(box.width() / cell + 1), rows_(box.depth() / cell + 1) {
    cells_.resize(static_cast<std::size_t>(columns_ * rows_));
  }
  std::int64_t columns() const { return columns_; }
  std::int64_t rows() const { return rows_; }
  /// An odd nm off the middle of the cell: on no edge of a part.
  Point2 middle(std::int64_t i, std::int64_t j) const {
    return {static_cast<Nm>(low_.x + i * cell_ + cell_ / 2 + 7), static_cast<Nm>(low_.y + j * cell_ + cell_ / 2 + 3)};
  }
  std::uint8_t& at(std::int64_t i, std::int64_t j) { return cells_[static_cast<std::size_t>(j * columns_ + i)]; }
  void clear() { std::fill(cells_.begin(), cells_.end(), std::uint8_t{0}); }

  /// Marks the cells whose middle is in a region, row by row.
  void mark_inside(const ContoursView& region) {
    std::vector<std::vector<std::pair<double, int>>> crossings(static_cast<std::size_t>(rows_));
    for (std::uint32_t c = 0; c < region.size(); ++c) {
      Point2 a = region[c].back();
      for (const Point2 b : region[c]) {
        const auto [low, high] = std::minmax(a.y, b.y);
        for (std::int64_t j = std::max<std::int64_t>(0, (low - low_.y) / cell_ - 1); j < rows_; ++j) {
          const Nm y = middle(0, j).y;
          if (y >= high) break;
          if (y < low) continue;
          const double x =
              a.x + (static_cast<double>(b.x) - a.x) * (static_cast<double>(y) - a.y) / (static_cast<double>(b.y) - a.y);
          crossings[static_cast<std::size_t>(j)].emplace_back(x, b.y > a.y ? 1 : -1);
        }
        a = b;
      }
    }
    for (std::int64_t j = 0; j < rows_; ++j) {
      auto& row = crossings[static_cast<std::size_t>(j)];
      std::ranges::sort(row);
      int winding = 0;
      std::size_t next = 0;
      for (std::int64_t i = 0; i < columns_; ++i) {
        while (next < row.size() && row[next].first <= middle(i, j).x) winding += row[next++].second;
        at(i, j) = winding != 0 ? 1 : 0;
      }
    }
  }

  /// Marks the cells whose middle is within `reach` nm of a line.
  void mark(Point2 a, Point2 b, double reach) {
    const auto column = [&](double x) {
      return static_cast<std::int64_t>(std::floor((x - static_cast<double>(low_.x)) / cell_));
    };
    const auto row = [&](double y) { return static_cast<std::int64_t>(std::floor((y - static_cast<double>(low_.y)) / cell_)); };
    const auto [y0, y1] = std::minmax(a.y, b.y);
    const double dx = static_cast<double>(b.x) - a.x, dy = static_cast<double>(b.y) - a.y;
    for (std::int64_t j = std::max<std::int64_t>(0, row(y0 - reach)); j <= std::min(rows_ - 1, row(y1 + reach)); ++j) {
      // The part of the line that is within reach of the row.
      double from = 0, to = 1;
      if (std::abs(dy) > reach) {
        const auto [t0, t1] = std::minmax({(middle(0, j).y - reach - a.y) / dy, (middle(0, j).y + reach - a.y) / dy});
        from = std::clamp(t0, 0.0, 1.0), to = std::clamp(t1, 0.0, 1.0);
      }
      const auto [x0, x1] = std::minmax({a.x + from * dx, a.x + to * dx});
      for (std::int64_t i = std::max<std::int64_t>(0, column(x0 - reach)); i <= std::min(columns_ - 1, column(x1 + reach));
           ++i) {
        const Point2 p = middle(i, j);
        const double px = static_cast<double>(p.x) - a.x, py = static_cast<double>(p.y) - a.y;
        const double along = std::clamp((px * dx + py * dy) / std::max(dx * dx + dy * dy, 1.0), 0.0, 1.0);
        if (std::hypot(px - along * dx, py - along * dy) <= reach) at(i, j) = 1;
      }
    }
  }

 private:
  Nm cell_;
  struct {
    std::int64_t x, y;
  } low_;
  std::int64_t columns_, rows_;
  std::vector<std::uint8_t> cells_;
};

struct Coverage {
  std::uint64_t faces = 0, bare = 0;
  std::string first;  // of the bare ones
};

/// Marks what walls and solid lines of a layer reach.
void mark_beads(const Sections& sections, std::uint32_t k, Nm cell, CellGrid& beads) {
  Sections::Work work;
  EXPECT_TRUE(sections.layer(k, work).ok());
  beads.clear();
  for (std::uint32_t p = 0; p < work.paths.size(); ++p) {
    for (std::uint32_t i = work.paths.offset[p]; i + 1 < work.paths.offset[p + 1]; ++i) {
      const PathKind kind = work.paths.kind[i];
      if (kind == PathKind::kOuter || kind == PathKind::kInner || kind == PathKind::kSolid) {
        beads.mark(work.paths.point[i], work.paths.point[i + 1], work.paths.width[i] / std::sqrt(2.0) + cell / 4.0);
      }
    }
  }
}

/// The cells of horizontal faces, and those without a wall or a solid line. A cell is covered within the half diagonal of a
/// bead's square: round ends of beads leave less bare than that.
Coverage coverage_of(const std::string& path, double layer_mm, const std::vector<std::string>& keys, Nm cell = 100'000) {
  Job job;
  job.parts.emplace_back().path = path;
  job.machine.profile = "marlin";
  job.layer_mm = layer_mm;
  job.named = {"layers.thickness_mm"};
  job.leave_to_machine = job.dry_run = true;
  for (const std::string& key : keys) EXPECT_TRUE(set_key(job, key).ok()) << key;
  const auto plan = plan_of(job, Product::kMoves);
  EXPECT_TRUE(plan.ok()) << (plan ? "" : plan.error().message);
  Coverage found;
  if (!plan) return found;
  const Sections& sections = *plan->sections;
  CellGrid beads(sections.bounds(), cell);
  const auto count = static_cast<std::uint32_t>(sections.layers().size());
  CellGrid last(sections.bounds(), cell), over(sections.bounds(), cell);  // layers k - 1 and k + 1
  for (std::uint32_t k = 0; k < count; ++k) {
    const auto mask_of = [&](std::uint32_t layer) {
      CellGrid mask(sections.bounds(), cell);
      const auto contours = sections.shared_contours(layer);
      EXPECT_TRUE(contours.ok());
      if (contours) mask.mark_inside((*contours)->contours.contours);
      return mask;
    };
    CellGrid under = k > 0 ? std::move(over) : CellGrid(sections.bounds(), cell);  // `over` of the layer before is this one
    CellGrid own = k > 0 ? std::move(under) : mask_of(k);
    under = std::move(last);
    over = k + 1 < count ? mask_of(k + 1) : CellGrid(sections.bounds(), cell);
    const auto is_face = [&](std::int64_t i, std::int64_t j) {
      return own.at(i, j) != 0 && (over.at(i, j) == 0 || under.at(i, j) == 0);
    };
    std::uint64_t faces = 0;
    for (std::int64_t j = 0; j < beads.rows(); ++j) {
      for (std::int64_t i = 0; i < beads.columns(); ++i) faces += is_face(i, j) ? 1 : 0;
    }
    found.faces += faces;
    if (faces > 0) mark_beads(sections, k, cell, beads);
    for (std::int64_t j = 0; faces > 0 && j < beads.rows(); ++j) {
      for (std::int64_t i = 0; i < beads.columns(); ++i) {
        if (!is_face(i, j) || beads.at(i, j) != 0) continue;
        ++found.bare;
        const Point2 p = beads.middle(i, j);
        if (found.first.empty())
          found.first = "layer " + std::to_string(k) + " at " + std::to_string(mm(p.x)) + ", " + std::to_string(mm(p.y));
      }
    }
    last = std::move(own);
  }
  return found;
}

TEST(Skins, NoPointOfAFaceIsWithoutASolidBead) {
  const Directory directory;
  const std::string box = directory / "box.stl";
  write_box(box, {0, 0, 0}, {10, 10, 3});
  const std::string nut = kCorpus + "parameter_quality_nut.stl", artifact = kCorpus + "nist_am_test_artifact_v3b.stl";
  for (const auto& [path, layer_mm] : {std::pair{nut, 0.2}, {box, 0.3}, {artifact, 0.3}}) {
    for (const std::string keys : {"fill.angle_deg=45", "fill.angle_deg=17", "fill.top_layers=2"}) {
      const Coverage found = coverage_of(path, layer_mm, {keys}, path == artifact ? 200'000 : 100'000);
      EXPECT_GT(found.faces, 5'000u) << path;
      EXPECT_EQ(found.bare, 0u) << path << ", " << keys << ": " << found.first;
    }
  }
}

TEST(Skins, WithoutThemFacesAreBare) {
  const Coverage found = coverage_of(kCorpus + "parameter_quality_nut.stl", 0.2, {"fill.top_layers=0", "fill.bottom_layers=0"});
  EXPECT_GT(found.bare, 1000u);
}

}  // namespace
}  // namespace lamina::test
