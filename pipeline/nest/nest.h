// pipeline/nest/nest.h: which part of an order goes into which build, and where.
//
//   rows ─> kinds (files in a resting position) ─> shadows by turn ─> builds, level by level
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/nest/order_table.h"
#include "stages/arrange/bed_level.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// What a nesting is for. All lengths nm.
struct NestSpace {
  arrange::BedOutline bed;
  std::vector<arrange::KeepOut> keep_out;
  std::int64_t height = 0, gap = 0;
  std::int64_t cell = 0;            // of rows of bits; 0: a thousandth of the bed's longer side
  std::vector<MicroDegrees> turns;  // of rows that state none
  std::uint32_t max_builds = UINT32_MAX;
};

/// A copy in a build.
struct NestedCopy {
  std::uint32_t row = 0, copy = 0;  // of the table; from 0
  double x_mm = 0, y_mm = 0;        // lower corner of its box on the bed
  double width_mm = 0, depth_mm = 0, height_mm = 0;
  MicroDegrees turn = 0;
  std::uint32_t picture = 0;  // of NestPlan::pictures
};

struct NestBuild {
  std::string material;
  std::vector<NestedCopy> copies;
  double height_mm = 0;   // of the highest part
  double area_mm2 = 0;    // of shadows
  double volume_mm3 = 0;  // of parts
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
  std::uint32_t kinds = 0;
  // --- for drawing
  std::array<double, 2> bed_mm{0, 0};
  bool round = false;
  std::vector<arrange::BitShape> pictures;  // what parts cover, in larger cells
  double picture_cell_mm = 0;
};

/// Rows of higher priority come first, then those that are due earlier; of equal ones several orders by size are tried, and the
/// one that covers most is kept. Each position is the front-most one that is free, in the turn that ends front-most.
///
/// options  units, scales and repair of parts: those of job.parts.front() if there is one
/// returns  the same for any number of threads: every copy is in one build, or left out
/// errors   of load_scene; kUsage: a margin that leaves no bed, fixed parts that overlap
/// cost     reading each kind once, O(triangles) a turn, and O(rows of cells of the bed and of the shape) a kind, turn and
/// build
Result<NestPlan> nest_orders(const std::vector<OrderRow>& rows, const NestSpace& space, const Job& options);

/// Rotation about x, y and z, in degrees, that puts a part with a face down, then turns it about z.
std::array<double, 3> rotation_of(const OrderRow& row, MicroDegrees turn);

}  // namespace lamina::pipeline
