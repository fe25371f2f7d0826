#include "stages/raster/scan.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace lamina::raster {
namespace {

constexpr std::size_t kAhead = 8, kLine = 64;  // visits, bytes

/// Visits from the first on to clusters of one block (mesh_blocks.h).
std::size_t visits_of_block(std::span<const PlacedMesh> placed, std::span<const ClusterVisit> visits) {
  constexpr std::uint32_t kClusters = MeshBlocks::kClusters;
  const ClusterVisit first = visits.front();
  const std::uint32_t first_cap = placed[first.instance].mesh->first_cap;
  const bool is_cap = first.cluster >= first_cap;
  const std::uint32_t before = is_cap ? first_cap : 0;
  const std::uint32_t begin = before + (first.cluster - before) / kClusters * kClusters;
  const std::uint32_t size = is_cap ? kClusters : std::min(kClusters, first_cap - begin);
  std::size_t count = 1;
  while (count < visits.size() && visits[count].instance == first.instance && visits[count].cluster - begin < size) ++count;
  return count;
}

}  // namespace

/// A mesh is larger than the caches, so clusters are fetched early, those of a block while those of the block before are
/// processed.
void cut_clusters(const RowBand& band, std::span<const ClusterVisit> visits, Segments& out) {
  const Kernels& kernels = band.kernels;
  const std::span<const PlacedMesh> placed = band.placed;
  const Nm plane = band.plane;
  const CutTask task{band.sampling, plane, band.first_row, band.last_row, out};
  FoundFacets found;
  CutFacets facets;
  std::uint32_t instance = 0;  // of those found
  const auto cut_found = [&] {
    if (found.size > 0) kernels.cut_found(task, instance, placed[instance].offset, found);
  };
  const auto fetch = [&](std::size_t i) __attribute__((always_inline)) {
    if (i >= visits.size()) return;
    const std::span<const char> stored = placed[visits[i].instance].mesh->blocks->stored(visits[i].cluster);
    for (std::size_t line = 0; line < stored.size(); line += kLine) __builtin_prefetch(stored.data() + line);
  };
  for (std::size_t i = 0; i < visits.size();) {
    const ClusterVisit visit = visits[i];
    const PlacedMesh& source = placed[visit.instance];
    const MeshBlocks::Indexed indexed = source.mesh->blocks->indexed(visit.cluster);
    if (indexed.cluster == nullptr) {
      fetch(i + kAhead);
      if (facets.is_full()) kernels.cut(task, facets);
      kernels.gather_listed(
          {&source.mesh->blocks->listed(visit.cluster), visit.cluster * kClusterSize, visit.instance, source.offset}, plane,
          facets);
      ++i;
      continue;
    }
    std::span<const ClusterVisit> of_block = visits.subspan(i, visits_of_block(placed, visits.subspan(i)));
    i += of_block.size();
    for (std::size_t k = 0; k < kAhead; ++k) fetch(i + k);
    if (visit.instance != instance || !found.reaches(indexed.vertex)) cut_found();
    instance = visit.instance;
    found.reaches(indexed.vertex);
    const IndexedSource block{indexed.cluster, visit.cluster, indexed.vertex,
                              indexed.step_of(std::int64_t{plane} + kPlaneReach - source.offset.z)};
    while (!of_block.empty()) {
      if (found.is_full()) cut_found(), found.reaches(indexed.vertex);
      of_block = of_block.subspan(kernels.find(block, of_block, found));
    }
  }
  cut_found();
  kernels.cut(task, facets);
}

void LayerReport::add_solid(const LayerReport& solid) {
  if (capped_rows == 0) {
    first_capped_row = solid.first_capped_row;
    first_capped_instance = solid.first_capped_instance;
  }
  if (open_rows == 0) first_open_row = solid.first_open_row;
  crossings += solid.crossings;
  capped_rows += solid.capped_rows;
  open_rows += solid.open_rows;
  level.keep_larger(solid.level);
}

void ScanConverter::fill(const RowBand& band, const Segments& segments) {
  const std::uint32_t first_row = band.first_row, rows = band.rows();
  position_.assign(std::size_t{rows} + 1, 0);
  std::uint32_t* const position = position_.data();
  for (std::size_t i = 0; i < segments.size; ++i) {
    const SegmentRows segment = segments.rows[i];
    ++position[segment.first - first_row];
    --position[segment.end() - first_row];
  }
  for (const Closing& closing : closing_) {
    ++position[closing.row - first_row];
    --position[closing.row - first_row + 1];
  }
  std::uint32_t in_row = 0, total = 0;
  for (std::uint32_t row = 0; row < rows; ++row) {
    in_row += position[row];
    position[row] = total;
    total += in_row;
  }
  crossings_ = total;
  ensure_capacity(crossing_, std::size_t{total} + RowsTask::kMoreCrossings);
  crossing_.resize(std::size_t{total} + RowsTask::kMoreCrossings);
  for (const Closing& closing : closing_) crossing_[position[closing.row - first_row]++] = closing.crossing;
  band.kernels.fill({band.sampling, segments, band.placed, band.plane, first_row, position, crossing_.data()});
}

/// The crossings that close the part whose crossings are filled in.
void ScanConverter::close_part(const RowBand& band, Buffer<Closing>& closings) const {
  for (std::uint32_t row = 0; row < band.rows(); ++row) {
    std::int32_t winding = 0;
    std::uint32_t last = 0;
    for (std::uint32_t i = row == 0 ? 0 : position_[row - 1]; i < position_[row]; ++i) {
      winding += (crossing_[i] & 1) != 0 ? 1 : -1;
      last = std::max(last, crossing_[i] >> 1);
    }
    const std::uint32_t closing = last * 2 + (winding < 0 ? 1 : 0);
    closings.insert(closings.end(), static_cast<std::size_t>(std::abs(winding)), {band.first_row + row, closing});
  }
}

void ScanConverter::close_open_parts(const RowBand& band, const Segments& segments, LayerReport& report) {
  of_open_parts_.clear();
  closing_.clear();
  if (std::ranges::all_of(band.placed, [](const PlacedMesh& part) { return part.mesh->closed; })) return;
  const auto instance_of = [&](std::uint32_t i) { return segments.origin[i].instance; };
  for (std::uint32_t i = 0; i < segments.size; ++i) {
    if (!band.placed[instance_of(i)].mesh->closed) of_open_parts_.push_back(i);
  }
  std::ranges::sort(of_open_parts_, {}, instance_of);
  of_part_.size = 0;
  of_part_.ensure_capacity(of_open_parts_.size());
  Buffer<Closing> closings;  // closing_ stays empty while the crossings of single parts are placed
  for (auto i = of_open_parts_.begin(); i != of_open_parts_.end();) {
    const std::uint32_t instance = instance_of(*i);
    of_part_.size = 0;
    for (; i != of_open_parts_.end() && instance_of(*i) == instance; ++i) of_part_.append(segments, *i);
    fill(band, of_part_);
    close_part(band, closings);
  }
  closing_ = std::move(closings);
  if (closing_.empty()) return;
  capped_.assign(band.rows(), 0);
  for (const Closing& closing : closing_) capped_[closing.row - band.first_row] = 1;
  report.open_rows += static_cast<std::uint32_t>(std::ranges::count(capped_, 1));
  report.first_open_row = std::ranges::min(closing_, {}, &Closing::row).row;  // bands come from the back
}

void ScanConverter::report_caps(const RowBand& band, const Segments& segments, LayerReport& report) {
  const std::span<const PlacedMesh> placed = band.placed;
  if (std::ranges::all_of(placed, [](const PlacedMesh& part) { return part.mesh->first_cap == part.mesh->cluster_count(); })) {
    return;
  }
  capped_.clear();
  for (std::size_t i = 0; i < segments.size; ++i) {
    const SegmentOrigin& origin = segments.origin[i];
    if (origin.facet / kClusterSize < placed[origin.instance].mesh->first_cap) continue;
    if (capped_.empty()) {
      capped_.assign(band.rows(), 0);
      report.first_capped_row = band.last_row;  // bands come from the back, so any row of this one is lower
    }
    const SegmentRows segment = segments.rows[i];
    std::memset(capped_.data() + (segment.first - band.first_row), 1, segment.count());
    if (segment.first < report.first_capped_row) {
      report.first_capped_row = segment.first;
      report.first_capped_instance = origin.instance;
    }
  }
  report.capped_rows += static_cast<std::uint32_t>(std::ranges::count(capped_, 1));
}

void ScanConverter::append_rows(const RowBand& band, const Segments& segments, FillRule rule, Runs& out, LayerReport& report) {
  const std::uint32_t rows = band.rows();
  const std::size_t out_rows = out.row_offset.size(), out_changes = out.change.size();
  out.row_offset.resize(out_rows + rows);
  std::uint32_t* const row_end = out.row_offset.data() + out_rows;
  if (segments.size == 0) {
    std::fill_n(row_end, rows, static_cast<std::uint32_t>(out_changes));
    return;
  }

  close_open_parts(band, segments, report);
  fill(band, segments);
  report.segments += static_cast<std::uint32_t>(segments.size);
  report.crossings += crossings_;
  report_caps(band, segments, report);

  out.change.resize(out_changes + crossings_ + RowsTask::kMoreCrossings);  // a change has a crossing of its own
  std::uint32_t* const changes = out.change.data();
  const std::uint32_t* const end =
      band.kernels.rows({crossing_.data(), position_.data(), rows, rule, changes, changes + out_changes, row_end});
  out.change.resize(static_cast<std::size_t>(end - changes));
}

}  // namespace lamina::raster
