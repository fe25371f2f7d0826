// pipeline/nest/nest.h: which part of an order goes into which build, and where.
//
//   rows ─> kinds (files in a resting position) ─> shadows by turn ─> builds, level by level
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/nest/order_table.h"
#include "stages/arrange/bed_level.h"
#include "stages/cost/cost.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// What a nesting is for. All lengths nm.
struct NestSpace {
  arrange::BedOutline bed;
  std::vector<arrange::KeepOut> keep_out;
  std::vector<std::string> keep_out_files;  // meshes in the frame of the bed, in mm: nothing may be above or below them
  std::int64_t height = 0, gap = 0;
  std::string machine;              // its name; may be empty
  std::int64_t cell = 0;            // of rows of bits; 0: a two thousandth of the bed's longer side
  std::vector<MicroDegrees> turns;  // of rows that state none
  std::uint32_t max_builds = UINT32_MAX;
  bool into = false;  // one build, which is there already
};

/// A copy in a build.
struct NestedCopy {
  std::uint32_t row = 0, copy = 0;  // of the table; from 0
  double x_mm = 0, y_mm = 0;        // lower corner of its box on the bed
  double width_mm = 0, depth_mm = 0, height_mm = 0;
  MicroDegrees turn = 0;
  std::uint32_t picture = 0;   // of NestPlan::pictures
  std::uint32_t sections = 0;  // of NestPlan::sections
};

/// What a build takes: an estimate from some of its layers (plate.h).
struct BuildUse {
  std::uint32_t layers = 0;
  cost::Quote quote;  // parts: the copies of the build
  Machine::Cost prices;
};

struct NestBuild {
  std::string material;
  std::vector<NestedCopy> copies;
  double height_mm = 0;              // of the highest part
  double area_mm2 = 0;               // of shadows
  double volume_mm3 = 0;             // of parts
  std::string name = {};             // "" for "build N"
  std::optional<BuildUse> use = {};  // of a powder printer, once it is quoted
};

/// Copies without a build.
struct LeftOut {
  std::uint32_t row = 0, copies = 0;
  std::string reason;
};

struct NestPlan {
  std::vector<NestBuild> builds;
  std::vector<LeftOut> left_out;
  double bed_mm2 = 0;  // without margin and keep-outs
  double box_mm3 = 0;  // of the machine, margins included; 0: without a height
  double box_height_mm = 0;
  std::uint32_t kinds = 0;
  // --- for drawing
  std::array<double, 2> bed_mm{0, 0};
  bool round = false;
  std::vector<arrange::BitShape> pictures;  // what parts cover, in larger cells
  double picture_cell_mm = 0;
  // --- for shares of cost
  std::vector<std::vector<double>> sections;  // areas of a kind, mm2, from its lowest to its highest point
  std::vector<double> volumes_mm3;            // of these kinds
};

/// Rows of higher priority come first, then those that are due earlier; of equal ones several orders by size are tried, and the
/// one that covers most is kept. Each position is the front-most one that is free, in the turn that ends front-most.
///
/// options  repair of parts; units, scales and rotations are those of settings_of()
/// returns  the same for any number of threads: every copy is in one build, or left out
/// errors   of load_scene; kUsage: a margin that leaves no bed, fixed parts nearer than the gap
/// cost     reading each kind once, O(triangles) a turn, and O(rows of cells of the bed and of the shape) a kind, turn and
/// build
Result<NestPlan> nest_orders(const std::vector<OrderRow>& rows, const NestSpace& space, const Job& options);

/// Sets the copies of rows that fill builds to those that builds have.
void count_fillers(const NestPlan& plan, std::vector<OrderRow>& rows);

/// Rotation about x, y and z, in degrees, that puts a part with a face down, then turns it about z.
std::array<double, 3> rotation_of(const OrderRow& row, MicroDegrees turn);

/// The settings of a row's part: those of its request in a job, if the job has one.
PartRequest settings_of(const OrderRow& row, const Job& options);

}  // namespace lamina::pipeline
