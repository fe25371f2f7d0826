#include "pipeline/nest/nest.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "pipeline/job/errors.h"
#include "pipeline/plan/scene.h"
#include "stages/arrange/fill_build.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

/// A file in a resting position, in all turns that a row allows.
struct Kind {
  const OrderRow* first;  // of the rows that have it
  std::set<MicroDegrees> turns;
  std::map<MicroDegrees, arrange::Shadow> shadows;
  std::map<std::uint32_t, arrange::Shadow> fixed;  // of rows with a position, in the cells of the bed
  double volume_mm3 = 0;
  std::int64_t height = 0;
};

constexpr std::uint32_t kPictureCells = 4;  // of the bed, along a cell of a picture

using KindName = std::tuple<std::string, char, bool>;
KindName kind_of(const OrderRow& row) { return {row.path, row.down_axis, row.down_positive}; }

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
  PartRequest part = options.parts.empty() ? PartRequest() : options.parts.front();
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

Result<std::map<KindName, Kind>> load_kinds(const std::vector<OrderRow>& rows, const NestSpace& space,
                                            const arrange::BedCells& bed, const Job& options) {
  std::map<KindName, Kind> kinds;
  std::vector<Kind*> list;
  for (std::uint32_t r = 0; r < rows.size(); ++r) {
    const OrderRow& row = rows[r];
    Kind& kind = kinds.try_emplace(kind_of(row), Kind{&row, {}, {}, {}}).first->second;
    const auto& turns = turns_of(row, space);
    kind.turns.insert(turns.begin(), turns.end());
    if (row.fixed_mm) kind.fixed[r];
  }
  for (auto& [name, kind] : kinds) list.push_back(&kind);
  std::vector<Status> status(list.size());
  tbb::parallel_for(std::size_t{0}, list.size(), [&](std::size_t i) { status[i] = load_kind(rows, options, bed, *list[i]); });
  for (const Status& each : status)
    if (!each) return each.error();
  return kinds;
}

/// The shapes of rows, and the rows as the filling of builds takes them.
class Nester {
 public:
  Nester(const std::vector<OrderRow>& rows, const NestSpace& space, const std::map<KindName, Kind>& kinds,
         const arrange::BedCells& bed)
      : rows_(rows), space_(space), kinds_(kinds), bed_(bed) {}

  Result<NestPlan> run();

 private:
  const Kind& kind(std::uint32_t row) const { return kinds_.at(kind_of(rows_[row])); }
  std::uint32_t shape_of(std::uint32_t row, MicroDegrees turn);
  std::string why_not(std::uint32_t row) const;
  Status put_fixed(const std::vector<std::uint32_t>& rows, NestBuild& build, std::vector<arrange::FixedShape>& fixed);
  Status nest_material(const std::string& material, NestPlan& plan);
  void add_copy(std::uint32_t row, MicroDegrees turn, double x_mm, double y_mm, NestBuild& build);
  std::uint32_t picture_of(std::uint32_t row, MicroDegrees turn, const arrange::BitShape& shape);

  const std::vector<OrderRow>& rows_;
  const NestSpace& space_;
  const std::map<KindName, Kind>& kinds_;
  const arrange::BedCells& bed_;
  std::vector<arrange::NestShape> shapes_;
  std::vector<std::pair<std::uint32_t, MicroDegrees>> shape_source_;  // row, turn
  std::map<std::tuple<KindName, MicroDegrees, std::int64_t>, std::uint32_t> shape_number_;
  std::map<std::string, std::vector<std::uint32_t>> of_material_;  // rows that may fit
  std::vector<std::uint32_t> next_copy_;
  std::vector<arrange::BitShape> pictures_;
  std::map<std::pair<KindName, MicroDegrees>, std::uint32_t> picture_number_;
};

/// The shape of a row in a turn, with its own distance to others.
std::uint32_t Nester::shape_of(std::uint32_t row, MicroDegrees turn) {
  const std::int64_t own = std::max(space_.gap, nm_of(rows_[row].keep_apart_mm));
  const auto [known, fresh] =
      shape_number_.try_emplace({kind_of(rows_[row]), turn, own}, static_cast<std::uint32_t>(shapes_.size()));
  if (fresh) {
    const arrange::Shadow& shadow = kind(row).shadows.at(turn);
    // Others are grown by the gap of all: what one row needs more, its own shape brings along.
    shapes_.push_back({arrange::grown_shape(shadow.shape, own - space_.gap, bed_.cell),
                       arrange::grown_shape(shadow.shape, own, bed_.cell), shadow.area_mm2});
    shape_source_.emplace_back(row, turn);
  }
  return known->second;
}

/// "" if a copy of a row fits an empty bed.
std::string Nester::why_not(std::uint32_t row) const {
  const Kind& own = kind(row);
  if (own.height > space_.height)
    return fmt::format("is {:g} mm high, and the machine builds {:g} mm", mm(own.height), mm(space_.height));
  const auto& turns = turns_of(rows_[row], space_);
  const auto fits = [&](MicroDegrees turn) {
    const arrange::Shadow& shadow = own.shadows.at(turn);
    arrange::BedLevel level(bed_, 1);
    const std::int64_t more = std::max<std::int64_t>(0, nm_of(rows_[row].keep_apart_mm) - space_.gap);
    return level.find(0, arrange::grown_shape(shadow.shape, more, bed_.cell).shape).has_value();
  };
  if (std::ranges::any_of(turns, fits)) return {};
  const arrange::Shadow& shadow = own.shadows.at(turns.front());
  return fmt::format("{:.3f} x {:.3f} mm fit the free bed in none of {} turns", mm(shadow.width), mm(shadow.depth),
                     turns.size());
}

/// The picture of a row in a turn, in cells four times as large.
std::uint32_t Nester::picture_of(std::uint32_t row, MicroDegrees turn, const arrange::BitShape& shape) {
  const auto [known, fresh] =
      picture_number_.try_emplace({kind_of(rows_[row]), turn}, static_cast<std::uint32_t>(pictures_.size()));
  if (fresh) pictures_.push_back(arrange::coarse_shape(shape, kPictureCells));
  return known->second;
}

void Nester::add_copy(std::uint32_t row, MicroDegrees turn, double x_mm, double y_mm, NestBuild& build) {
  const Kind& own = kind(row);
  const auto fixed = own.fixed.find(row);
  const arrange::Shadow& shadow = fixed != own.fixed.end() ? fixed->second : own.shadows.at(turn);
  build.copies.push_back({row, next_copy_[row]++, x_mm, y_mm, mm(shadow.width), mm(shadow.depth), mm(shadow.height), turn,
                          picture_of(row, turn, shadow.shape)});
  build.height_mm = std::max(build.height_mm, mm(shadow.height));
  build.area_mm2 += shadow.area_mm2;
  build.volume_mm3 += own.volume_mm3;
}

/// Puts the rows with positions. errors  kUsage: outside of the bed, or overlaps
Status Nester::put_fixed(const std::vector<std::uint32_t>& rows, NestBuild& build, std::vector<arrange::FixedShape>& fixed) {
  arrange::BedLevel level(bed_, 0);
  for (const std::uint32_t row : rows) {
    const OrderRow& own = rows_[row];
    const arrange::Shadow& shadow = kind(row).fixed.at(row);
    const CellOffset x = offset_of((*own.fixed_mm)[0], bed_.x0, bed_.cell),
                     y = offset_of((*own.fixed_mm)[1], bed_.y0, bed_.cell);
    const arrange::CellPosition at{static_cast<std::uint32_t>(std::max<std::int64_t>(x.cell, 0)),
                                   static_cast<std::uint32_t>(std::max<std::int64_t>(y.cell, 0))};
    if (x.cell < 0 || y.cell < 0 || !level.is_free(shadow.shape, at))
      return usage(
          "{}: at {:g}, {:g} mm it overlaps another fixed part, the margin or a keep-out, or is nearer to them than {:g} mm; "
          "move it",
          one_line(own.path), (*own.fixed_mm)[0], (*own.fixed_mm)[1], mm(bed_.cell));
    level.put({shadow.shape, 0}, at);
    fixed.push_back({arrange::grown_shape(shadow.shape, std::max(space_.gap, nm_of(own.keep_apart_mm)), bed_.cell), at});
    add_copy(row, own.turns.empty() ? 0 : own.turns.front(), (*own.fixed_mm)[0], (*own.fixed_mm)[1], build);
  }
  return {};
}

Status Nester::nest_material(const std::string& material, NestPlan& plan) {
  std::vector<arrange::Demand> demands;
  std::map<std::string, std::uint32_t> groups;
  std::vector<std::uint32_t> fixed_rows;
  for (const std::uint32_t row : of_material_[material]) {
    if (rows_[row].fixed_mm) {
      fixed_rows.push_back(row);
      continue;
    }
    arrange::Demand demand;
    demand.row = row;
    demand.copies = rows_[row].copies;
    demand.rank = {-rows_[row].priority, rows_[row].due.value_or(INT32_MAX)};
    for (const MicroDegrees turn : turns_of(rows_[row], space_)) demand.shapes.push_back(shape_of(row, turn));
    if (!rows_[row].group.empty())
      demand.group = groups.try_emplace(rows_[row].group, static_cast<std::uint32_t>(groups.size())).first->second;
    demands.push_back(std::move(demand));
  }
  const auto left = [&] { return std::ranges::any_of(demands, [](const arrange::Demand& d) { return d.copies > 0; }); };
  while ((left() || !fixed_rows.empty()) && plan.builds.size() < space_.max_builds) {
    NestBuild build{material, {}, 0, 0, 0};
    std::vector<arrange::FixedShape> fixed;
    if (Status status = put_fixed(fixed_rows, build, fixed); !status) return status;
    fixed_rows.clear();
    for (const arrange::PutShape& put : arrange::fill_build(bed_, shapes_, demands, fixed)) {
      arrange::Demand& demand = demands[put.demand];
      --demand.copies;
      add_copy(demand.row, shape_source_[put.shape].second, mm(bed_.x0 + std::int64_t{put.at.x} * bed_.cell),
               mm(bed_.y0 + std::int64_t{put.at.y} * bed_.cell), build);
    }
    if (build.copies.empty()) break;
    plan.builds.push_back(std::move(build));
  }
  const std::string full =
      fmt::format("no space in {} build{} (--builds)", space_.max_builds, space_.max_builds == 1 ? "" : "s");
  for (const std::uint32_t row : fixed_rows) plan.left_out.push_back({row, rows_[row].copies, full});
  for (const arrange::Demand& demand : demands) {
    if (demand.copies == 0) continue;
    const std::string of_group = fmt::format("its group '{}' does not fit one build", rows_[demand.row].group);
    plan.left_out.push_back({demand.row, demand.copies, plan.builds.size() >= space_.max_builds ? full : of_group});
  }
  return {};
}

Result<NestPlan> Nester::run() {
  NestPlan plan;
  plan.kinds = static_cast<std::uint32_t>(kinds_.size());
  const double cells = static_cast<double>(bed_.blocked.width) * bed_.blocked.depth - static_cast<double>(bed_.blocked.count());
  plan.bed_mm2 = cells * mm(bed_.cell) * mm(bed_.cell);
  next_copy_.assign(rows_.size(), 0);
  for (std::uint32_t row = 0; row < rows_.size(); ++row) {
    if (std::string why = why_not(row); !why.empty()) {
      plan.left_out.push_back({row, rows_[row].copies, std::move(why)});
    } else {
      of_material_[rows_[row].material].push_back(row);
    }
  }
  for (const auto& [material, rows] : of_material_) {
    if (Status status = nest_material(material, plan); !status) return status.error();
  }
  std::ranges::sort(plan.left_out, {}, &LeftOut::row);
  plan.pictures = std::move(pictures_);
  plan.picture_cell_mm = mm(bed_.cell * kPictureCells);
  plan.bed_mm = {mm(space_.bed.width), mm(space_.bed.depth)};
  plan.round = space_.bed.round;
  return plan;
}

}  // namespace

std::array<double, 3> rotation_of(const OrderRow& row, MicroDegrees turn) {
  std::array<double, 3> rotation{0, 0, static_cast<double>(turn) * 1e-6};
  const double sign = row.down_positive ? 1 : -1;
  if (row.down_axis == 'z' && row.down_positive) rotation[0] = 180;
  if (row.down_axis == 'x') rotation[1] = 90 * sign;
  if (row.down_axis == 'y') rotation[0] = -90 * sign;
  return rotation;
}

Result<NestPlan> nest_orders(const std::vector<OrderRow>& rows, const NestSpace& space, const Job& options) {
  const std::int64_t cell = space.cell > 0 ? space.cell : std::max(space.bed.width, space.bed.depth) / 1000;
  const arrange::BedCells bed = arrange::bed_cells(space.bed, space.keep_out, cell);
  const std::uint64_t all = std::uint64_t{bed.blocked.width} * bed.blocked.depth;
  if (bed.blocked.count() == all)
    return usage("the margin of {:g} mm and keep-outs leave nothing of the bed of {:g} x {:g} mm", mm(space.bed.margin),
                 mm(space.bed.width), mm(space.bed.depth));
  const auto kinds = load_kinds(rows, space, bed, options);
  if (!kinds) return kinds.error();
  return Nester(rows, space, *kinds, bed).run();
}

}  // namespace lamina::pipeline
