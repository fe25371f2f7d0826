#include "pipeline/nest/nest.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/plan/scene.h"
#include "stages/arrange/fill_build.h"
#include "stages/cost/section_area.h"
#include "stages/load/load.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// A file in a resting position, in all turns that a row allows.
struct Kind {
  const OrderRow* first;  // of the rows that have it
  std::set<MicroDegrees> turns = {};
  std::map<MicroDegrees, arrange::Shadow> shadows = {};
  std::map<std::uint32_t, arrange::Shadow> fixed = {};  // of rows with a position, in the cells of the bed
  std::vector<double> sections = {};                    // areas, mm2
  double volume_mm3 = 0;
  std::int64_t height = 0;
};

constexpr std::uint32_t kPictureCells = 8;  // of the bed, along a cell of a picture
constexpr std::size_t kSections = 256;      // of a kind

using KindName = std::tuple<std::string, std::array<double, 2>, std::uint32_t>;
KindName kind_of(const OrderRow& row) { return {row.path, row.rest_deg, row.request}; }

/// "line 7: " of the table.
std::string line_of(const OrderRow& row) { return row.line > 0 ? fmt::format("line {}: ", row.line) : ""; }

const std::vector<MicroDegrees>& turns_of(const OrderRow& row, const NestSpace& space) {
  return row.turns.empty() ? space.turns : row.turns;
}

/// Of a fixed position: nm from the first cell of the bed, along one axis.
struct CellOffset {
  std::int64_t cell = 0, phase = 0;
};
CellOffset offset_of(double at_mm, std::int64_t first, std::int64_t cell) {
  const std::int64_t at = nm_of(at_mm) - first;
  return {floor_div(at, cell), at - floor_div(at, cell) * cell};
}

/// Loads a kind and makes its shadows. errors  of load_scene
Status load_kind(const std::vector<OrderRow>& rows, const Job& options, const arrange::BedCells& bed, Kind& kind) {
  Job job = options;
  PartRequest part = settings_of(*kind.first, options);
  part.path = kind.first->path;
  part.copies = 1;
  part.at_mm.reset();
  const std::array<double, 3> down = rotation_of(*kind.first, 0);
  if (down != std::array<double, 3>{0, 0, 0}) {
    if (part.rotate_deg != std::array<double, 3>{0, 0, 0})
      return usage("{}: has a column down and --rotate; leave out one of them", one_line(part.path));
    part.rotate_deg = down;
  }
  job.parts = {part};
  const auto scene = load_scene(job, kLargestBed);
  if (!scene) return scene.error();
  if (!scene->images.empty()) return usage("{}: is no mesh; nest takes STL, OBJ and 3MF", one_line(part.path));
  for (const Instance& instance : scene->instances) kind.volume_mm3 += scene->meshes[instance.mesh].volume_mm3;
  kind.sections = cost::section_areas(scene->meshes, scene->instances, kSections);
  for (const MicroDegrees turn : kind.turns)
    kind.height = (kind.shadows[turn] = arrange::shadow_of(scene->meshes, scene->instances, turn, bed.cell)).height;
  for (auto& [row, shadow] : kind.fixed) {
    const std::array<double, 2>& at = *rows[row].fixed_mm;
    const MicroDegrees turn = rows[row].turns.empty() ? 0 : rows[row].turns.front();
    shadow = arrange::shadow_of(scene->meshes, scene->instances, turn, bed.cell,
                                {offset_of(at[0], bed.x0, bed.cell).phase, offset_of(at[1], bed.y0, bed.cell).phase});
  }
  return {};
}

/// Blocks what a mesh covers. errors  of load
Status keep_out_mesh(const std::string& path, arrange::BedCells& bed) {
  const auto part = load::load(path, {});
  if (!part) return part.error();
  Point3 low{INT32_MAX, INT32_MAX, 0};
  for (const Instance& instance : part->instances) {
    const Box& box = part->meshes[instance.mesh].bounds;
    low.x = std::min(low.x, box.lo.x + instance.offset.x);
    low.y = std::min(low.y, box.lo.y + instance.offset.y);
  }
  const CellOffset x = offset_of(mm(low.x), bed.x0, bed.cell), y = offset_of(mm(low.y), bed.y0, bed.cell);
  const arrange::Shadow shadow = arrange::shadow_of(part->meshes, part->instances, 0, bed.cell, {x.phase, y.phase});
  for (std::uint32_t row = 0; row < shadow.shape.depth; ++row) {
    const std::int64_t to = y.cell + row;
    if (to < 0 || to >= bed.blocked.depth) continue;
    arrange::for_each_run(shadow.shape.row(row), shadow.shape.width, [&](std::uint32_t begin, std::uint32_t end) {
      const auto column = [&](std::uint32_t c) {
        return static_cast<std::uint32_t>(std::clamp<std::int64_t>(x.cell + c, 0, bed.blocked.width));
      };
      bed.blocked.set(static_cast<std::uint32_t>(to), column(begin), column(end));
    });
  }
  return {};
}

Result<std::map<KindName, Kind>> load_kinds(const std::vector<OrderRow>& rows, const NestSpace& space,
                                            const arrange::BedCells& bed, const Job& options) {
  std::map<KindName, Kind> kinds;
  std::vector<Kind*> list;
  for (std::uint32_t r = 0; r < rows.size(); ++r) {
    const OrderRow& row = rows[r];
    Kind& kind = kinds.try_emplace(kind_of(row), Kind{&row}).first->second;
    const auto& turns = turns_of(row, space);
    kind.turns.insert(turns.begin(), turns.end());
    if (row.fixed_mm) kind.fixed[r];
  }
  for (auto& [name, kind] : kinds) list.push_back(&kind);
  std::vector<Status> status(list.size());
  tbb::parallel_for(std::size_t{0}, list.size(), [&](std::size_t i) { status[i] = load_kind(rows, options, bed, *list[i]); });
  for (std::size_t i = 0; i < list.size(); ++i)
    if (!status[i]) return failure(status[i].error().fault, "{}{}", line_of(*list[i]->first), status[i].error().message);
  return kinds;
}

/// The shapes of rows, and the rows as the filling of builds takes them.
class Nester {
 public:
  Nester(const std::vector<OrderRow>& rows, const NestSpace& space, const std::map<KindName, Kind>& kinds,
         const arrange::BedCells& bed)
      : rows_(rows), space_(space), kinds_(kinds), bed_(bed), empty_bed_(bed, 0) {}

  Result<NestPlan> run();

 private:
  using Rank = std::pair<std::int32_t, std::int32_t>;
  static constexpr Rank kFillers{INT32_MAX, INT32_MAX};
  /// What has no build yet.
  struct MaterialRows {
    std::vector<arrange::Demand> demands;
    std::vector<std::uint32_t> fixed;  // rows with a position
    bool stuck = false;                // an empty build had space for nothing
  };

  const Kind& kind(std::uint32_t row) const { return kinds_.at(kind_of(rows_[row])); }
  std::uint32_t shape_of(std::uint32_t row, MicroDegrees turn);
  std::string too_high(std::int64_t height) const;
  std::string why_not(std::uint32_t row);
  Status put_fixed(const std::vector<std::uint32_t>& rows, NestBuild& build, std::vector<arrange::FixedShape>& fixed);
  Status sort_rows(NestPlan& plan);
  MaterialRows demands_of(const std::vector<std::uint32_t>& rows);
  std::optional<Rank> next_rank(const MaterialRows& of, bool first) const;
  Status add_build(const std::string& material, MaterialRows& of, NestPlan& plan);
  Status make_builds(NestPlan& plan);
  void add_copy(std::uint32_t row, MicroDegrees turn, double x_mm, double y_mm, NestBuild& build);
  std::uint32_t sections_of(std::uint32_t row);
  std::uint32_t picture_of(std::uint32_t row, MicroDegrees turn, const arrange::BitShape& shape);

  const std::vector<OrderRow>& rows_;
  const NestSpace& space_;
  const std::map<KindName, Kind>& kinds_;
  const arrange::BedCells& bed_;
  arrange::BedLevel empty_bed_;
  std::vector<arrange::NestShape> shapes_;
  std::vector<std::pair<std::uint32_t, MicroDegrees>> shape_source_;  // row, turn
  std::map<std::tuple<KindName, MicroDegrees, std::int64_t>, std::uint32_t> shape_number_;
  std::map<std::string, std::vector<std::uint32_t>> of_material_;  // rows that may fit
  std::size_t fillers_ = 0;                                        // rows
  std::vector<std::uint32_t> next_copy_;
  std::vector<arrange::BitShape> pictures_;
  std::map<std::pair<KindName, MicroDegrees>, std::uint32_t> picture_number_;
  std::vector<std::vector<double>> sections_;
  std::vector<double> volumes_mm3_;
  std::map<KindName, std::uint32_t> sections_number_;
};

/// The shape of a row in a turn, with its own distance to others.
std::uint32_t Nester::shape_of(std::uint32_t row, MicroDegrees turn) {
  const std::int64_t own = std::max(space_.gap, nm_of(rows_[row].keep_apart_mm));
  const auto [known, fresh] =
      shape_number_.try_emplace({kind_of(rows_[row]), turn, own}, static_cast<std::uint32_t>(shapes_.size()));
  if (fresh) {
    const arrange::Shadow& shadow = kind(row).shadows.at(turn);
    // Others are grown by the gap of all: what one row needs more, its own shape brings along.
    shapes_.emplace_back(arrange::grown_shape(shadow.shape, own - space_.gap, bed_.cell),
                         arrange::grown_shape(shadow.shape, own, bed_.cell), shadow.area_mm2);
    shape_source_.emplace_back(row, turn);
  }
  return known->second;
}

/// "" if the machine builds a height.
std::string Nester::too_high(std::int64_t height) const {
  if (height <= space_.height - space_.bed.margin) return {};
  const std::string margin =
      space_.bed.margin > 0 ? fmt::format(", less a margin of {:g} mm at the top", mm(space_.bed.margin)) : "";
  return fmt::format("is {:g} mm high, and the machine builds {:g} mm{}", mm(height), mm(space_.height), margin);
}

/// "" if a copy of a row fits an empty bed.
std::string Nester::why_not(std::uint32_t row) {
  const Kind& own = kind(row);
  if (std::string why = too_high(own.height); !why.empty()) return why;
  const auto& turns = turns_of(rows_[row], space_);
  const std::int64_t more = std::max<std::int64_t>(0, nm_of(rows_[row].keep_apart_mm) - space_.gap);
  const auto fits = [&](MicroDegrees turn) {
    const arrange::GrownShape grown = arrange::grown_shape(own.shadows.at(turn).shape, more, bed_.cell);
    return empty_bed_.has_space(arrange::SearchShape(grown.shape));
  };
  if (std::ranges::any_of(turns, fits)) return {};
  const arrange::Shadow& shadow = own.shadows.at(turns.front());
  return fmt::format("{:.3f} x {:.3f} mm do not fit the free bed in any of {} turns", mm(shadow.width), mm(shadow.depth),
                     turns.size());
}

/// The picture of a row in a turn, in larger cells.
std::uint32_t Nester::picture_of(std::uint32_t row, MicroDegrees turn, const arrange::BitShape& shape) {
  const auto [known, fresh] =
      picture_number_.try_emplace({kind_of(rows_[row]), turn}, static_cast<std::uint32_t>(pictures_.size()));
  if (fresh) pictures_.push_back(arrange::coarse_shape(shape, kPictureCells));
  return known->second;
}

std::uint32_t Nester::sections_of(std::uint32_t row) {
  const auto [known, fresh] = sections_number_.try_emplace(kind_of(rows_[row]), static_cast<std::uint32_t>(sections_.size()));
  if (fresh) sections_.push_back(kind(row).sections), volumes_mm3_.push_back(kind(row).volume_mm3);
  return known->second;
}

void Nester::add_copy(std::uint32_t row, MicroDegrees turn, double x_mm, double y_mm, NestBuild& build) {
  const Kind& own = kind(row);
  const auto fixed = own.fixed.find(row);
  const arrange::Shadow& shadow = fixed != own.fixed.end() ? fixed->second : own.shadows.at(turn);
  build.copies.push_back({row, next_copy_[row]++, x_mm, y_mm, mm(shadow.width), mm(shadow.depth), mm(shadow.height), turn,
                          picture_of(row, turn, shadow.shape), sections_of(row)});
  build.height_mm = std::max(build.height_mm, mm(shadow.height));
  build.area_mm2 += shadow.area_mm2;
  build.volume_mm3 += own.volume_mm3;
}

/// Puts the rows with positions. errors  kUsage: outside of the bed, or overlaps
Status Nester::put_fixed(const std::vector<std::uint32_t>& rows, NestBuild& build, std::vector<arrange::FixedShape>& fixed) {
  const arrange::BedLevel empty(bed_, 0);
  arrange::BedLevel level(bed_, 0);
  for (const std::uint32_t row : rows) {
    const OrderRow& own = rows_[row];
    const arrange::Shadow& shadow = kind(row).fixed.at(row);
    if (std::string why = too_high(shadow.height); !why.empty())
      return usage("{}{}: {}", line_of(own), one_line(own.path), why);
    const CellOffset x = offset_of((*own.fixed_mm)[0], bed_.x0, bed_.cell),
                     y = offset_of((*own.fixed_mm)[1], bed_.y0, bed_.cell);
    const arrange::CellPosition at{static_cast<std::uint32_t>(std::max<std::int64_t>(x.cell, 0)),
                                   static_cast<std::uint32_t>(std::max<std::int64_t>(y.cell, 0))};
    if (x.cell < 0 || y.cell < 0 || !empty.is_free(shadow.shape, at))
      return usage("{}{}: at {:g}, {:g} mm it reaches into the margin or a keep-out; move it", line_of(own), one_line(own.path),
                   (*own.fixed_mm)[0], (*own.fixed_mm)[1]);
    if (!level.is_free(shadow.shape, at))
      return usage(
          "{}{}: at {:g}, {:g} mm it is nearer than the gap of {:g} mm to another fixed part; move one, or give a smaller --gap",
          line_of(own), one_line(own.path), (*own.fixed_mm)[0], (*own.fixed_mm)[1], mm(space_.gap));
    // Parts of a written build keep the distance that they have.
    level.put(
        own.serials.empty() ? arrange::grown_shape(shadow.shape, space_.gap, bed_.cell) : arrange::GrownShape{shadow.shape, 0},
        at);
    fixed.push_back({arrange::grown_shape(shadow.shape, std::max(space_.gap, nm_of(own.keep_apart_mm)), bed_.cell), at});
    add_copy(row, own.turns.empty() ? 0 : own.turns.front(), (*own.fixed_mm)[0], (*own.fixed_mm)[1], build);
  }
  return {};
}

Nester::MaterialRows Nester::demands_of(const std::vector<std::uint32_t>& rows) {
  MaterialRows of;
  std::map<std::string, std::uint32_t> groups;
  for (const std::uint32_t row : rows) {
    if (rows_[row].fixed_mm) {
      of.fixed.push_back(row);
      continue;
    }
    arrange::Demand demand;
    demand.row = row;
    demand.copies = rows_[row].copies;
    demand.rank = {-rows_[row].priority, rows_[row].due.value_or(INT32_MAX)};
    if (rows_[row].fills) demand.rank = kFillers;
    for (const MicroDegrees turn : turns_of(rows_[row], space_)) demand.shapes.push_back(shape_of(row, turn));
    if (!rows_[row].group.empty())
      demand.group = groups.try_emplace(rows_[row].group, static_cast<std::uint32_t>(groups.size())).first->second;
    of.demands.push_back(std::move(demand));
  }
  return of;
}

/// The best rank of what has no build yet; none if nothing has to have one. Parts with a position come first.
std::optional<Nester::Rank> Nester::next_rank(const MaterialRows& of, bool first) const {
  if (!of.fixed.empty()) return Rank{INT32_MIN, INT32_MIN};
  std::optional<Rank> best;
  for (const arrange::Demand& demand : of.demands) {
    // Copies that fill builds begin one only if there is nothing else.
    if (demand.copies == 0 || of.stuck || (rows_[demand.row].fills && !(first && of.demands.size() == fillers_))) continue;
    if (!best || demand.rank < *best) best = demand.rank;
  }
  return best;
}

Status Nester::add_build(const std::string& material, MaterialRows& of, NestPlan& plan) {
  NestBuild build{material, {}};
  std::vector<arrange::FixedShape> fixed;
  if (Status status = put_fixed(of.fixed, build, fixed); !status) return status;
  of.fixed.clear();
  for (const arrange::PutShape& put : arrange::fill_build(bed_, shapes_, of.demands, fixed)) {
    arrange::Demand& demand = of.demands[put.demand];
    --demand.copies;
    add_copy(demand.row, shape_source_[put.shape].second, mm(bed_.x0 + std::int64_t{put.at.x} * bed_.cell),
             mm(bed_.y0 + std::int64_t{put.at.y} * bed_.cell), build);
  }
  of.stuck = build.copies.empty();
  if (!of.stuck) plan.builds.push_back(std::move(build));
  return {};
}

/// Builds of the materials, the one with the best rank next.
Status Nester::make_builds(NestPlan& plan) {
  std::map<std::string, MaterialRows> materials;
  for (const auto& [material, rows] : of_material_) materials[material] = demands_of(rows);
  while (plan.builds.size() < space_.max_builds) {
    std::pair<const std::string, MaterialRows>* next = nullptr;
    std::optional<Rank> best;
    for (auto& each : materials) {
      const auto rank = next_rank(each.second, plan.builds.empty());
      if (rank && (!best || *rank < *best)) next = &each, best = rank;
    }
    if (next == nullptr) break;
    if (Status status = add_build(next->first, next->second, plan); !status) return status;
  }
  for (const auto& [material, of] : materials) {
    const bool has_build = std::ranges::count(plan.builds, material, &NestBuild::material) > 0;
    const std::string full = has_build ? "no space in" : "no build of its material in";
    const std::string why =
        space_.into ? "no space in the build"
                    : fmt::format("{} {} build{} (--builds)", full, space_.max_builds, space_.max_builds == 1 ? "" : "s");
    for (const std::uint32_t row : of.fixed) plan.left_out.push_back({row, rows_[row].copies, why});
    for (const arrange::Demand& demand : of.demands) {
      if (demand.copies == 0 || rows_[demand.row].fills) continue;
      const std::string of_group = fmt::format("its group '{}' does not fit one build", one_line(rows_[demand.row].group));
      plan.left_out.push_back({demand.row, demand.copies, of.stuck && !rows_[demand.row].group.empty() ? of_group : why});
    }
  }
  return {};
}

/// Rows that may fit, by material. Those with a position are checked when they are put there; a group is left out as a whole.
/// errors  kUsage: a part that is to fill builds fits none
Status Nester::sort_rows(NestPlan& plan) {
  std::vector<std::string> why(rows_.size());
  std::map<std::string, std::uint32_t> too_large;  // of a group
  for (std::uint32_t row = 0; row < rows_.size(); ++row) {
    if (!rows_[row].fixed_mm) why[row] = why_not(row);
    if (rows_[row].fills && !why[row].empty()) return usage("--fill {}: {}", one_line(rows_[row].path), why[row]);
    if (!why[row].empty() && !rows_[row].group.empty()) too_large.try_emplace(rows_[row].group, row);
  }
  std::vector<std::uint32_t> fillers;
  for (std::uint32_t row = 0; row < rows_.size(); ++row) {
    const auto of_group = too_large.find(rows_[row].group);
    if (why[row].empty() && of_group != too_large.end())
      why[row] = fmt::format("its group '{}' has {}, which fits no build", one_line(rows_[row].group),
                             one_line(fs::path(rows_[of_group->second].path).filename().string()));
    if (!why[row].empty()) {
      plan.left_out.push_back({row, rows_[row].copies, std::move(why[row])});
    } else if (rows_[row].fills) {
      fillers.push_back(row);
    } else {
      of_material_[rows_[row].material].push_back(row);
    }
  }
  if (of_material_.empty() && plan.left_out.empty()) of_material_[""];
  fillers_ = fillers.size();
  for (auto& [material, rows] : of_material_) rows.insert(rows.end(), fillers.begin(), fillers.end());
  return {};
}

Result<NestPlan> Nester::run() {
  NestPlan plan;
  plan.kinds = static_cast<std::uint32_t>(kinds_.size());
  const double cells = static_cast<double>(bed_.blocked.width) * bed_.blocked.depth - static_cast<double>(bed_.blocked.count());
  plan.bed_mm2 = cells * mm(bed_.cell) * mm(bed_.cell);
  if (space_.height < kNmReach) plan.box_height_mm = mm(space_.height);
  plan.box_mm3 = mm(space_.bed.width) * mm(space_.bed.depth) * plan.box_height_mm;
  if (space_.bed.round) plan.box_mm3 *= std::numbers::pi / 4;
  next_copy_.assign(rows_.size(), 0);
  if (Status status = sort_rows(plan); !status) return status.error();
  if (Status status = make_builds(plan); !status) return status.error();
  std::ranges::sort(plan.left_out, {}, &LeftOut::row);
  plan.pictures = std::move(pictures_);
  plan.sections = std::move(sections_);
  plan.volumes_mm3 = std::move(volumes_mm3_);
  plan.picture_cell_mm = mm(bed_.cell * kPictureCells);
  plan.bed_mm = {mm(space_.bed.width), mm(space_.bed.depth)};
  plan.round = space_.bed.round;
  return plan;
}

}  // namespace

std::array<double, 3> rotation_of(const OrderRow& row, MicroDegrees turn) {
  return {row.rest_deg[0], row.rest_deg[1], static_cast<double>(turn) * 1e-6};
}

PartRequest settings_of(const OrderRow& row, const Job& options) {
  return row.request < options.parts.size() ? options.parts[row.request] : PartRequest();
}

Result<NestPlan> nest_orders(const std::vector<OrderRow>& rows, const NestSpace& space, const Job& options) {
  const std::int64_t cell =
      space.cell > 0 ? space.cell : std::max<std::int64_t>(1, std::max(space.bed.width, space.bed.depth) / 2000);
  arrange::BedCells bed = arrange::bed_cells(space.bed, space.keep_out, cell);
  for (const std::string& file : space.keep_out_files)
    if (Status status = keep_out_mesh(file, bed); !status) return status.error();
  const std::uint64_t all = std::uint64_t{bed.blocked.width} * bed.blocked.depth;
  if (bed.blocked.count() == all)
    return usage("the margin of {:g} mm and keep-outs leave nothing of the bed of {:g} x {:g} mm", mm(space.bed.margin),
                 mm(space.bed.width), mm(space.bed.depth));
  const auto kinds = load_kinds(rows, space, bed, options);
  if (!kinds) return kinds.error();
  return Nester(rows, space, *kinds, bed).run();
}

void count_fillers(const NestPlan& plan, std::vector<OrderRow>& rows) {
  for (OrderRow& row : rows)
    if (row.fills) row.copies = 0;
  for (const NestBuild& build : plan.builds)
    for (const NestedCopy& copy : build.copies)
      if (rows[copy.row].fills) ++rows[copy.row].copies;
}

}  // namespace lamina::pipeline
