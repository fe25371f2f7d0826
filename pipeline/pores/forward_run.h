// pipeline/pores/forward_run.h: voxels and flow of the beads of a job of segmented lines, planned and solved.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/pores/predict_flow.h"
#include "stages/data/status.h"
#include "stages/segment/segmentation.h"

namespace lamina::pipeline {

/// Edges of voxels in um: pores are narrow across the lines, long along them.
struct ForwardGrid {
  double across_um = 10, along_um = 20, height_um = 10;
  std::uint32_t positions =
      2;  // of the voxels across the lines, whose results are averaged: walls fall between voxels otherwise
};

/// Of one period of the plan.
struct ForwardRun {
  double porosity = 0, porosity_through = 0;              // all void, and what leads through along z
  double permeability_m2 = 0, permeability_error_m2 = 0;  // Darcy's k1 along z; the error is that of the voxels
  bool resolved = true;                                   // false: voxels are too coarse for the pores
  double pore_length_mm = 0, pore_width_mm = 0;           // means of the pores that the written toolpaths leave; 0 without any
};

/// Layers of a job that are analysed.
struct ForwardRegion {
  segment::Segmentation plan;  // as the job's keys are resolved: it gives the period
  double middle_mm = 0;        // within a layer between others of the same plan
  std::string heights;         // as in the summary: "3 to 5.7 mm", or "" outside of all ranges
};

/// Plans a block of that height with the job through to toolpaths in a temporary folder, and analyses one period in the layer
/// of each region, of beads as the machine deposits them (bead_voxels.h).
/// job      of extrusion, without parts and output; all layers at one angle of 90 degrees
/// machine  as --machine takes it
/// advance  receives the progress, 0 .. 1; false stops
/// errors   of run() and analyse_pores(); kOutput: no temporary folder; kInternal: there is no layer at that height
/// cost     a second for each region and place of the voxels, 150 bytes a voxel of void
Result<std::vector<ForwardRun>> run_forward(Job job, const std::string& machine, double height_mm,
                                            const std::vector<ForwardRegion>& regions, const ForwardGrid& grid,
                                            const std::function<bool(double)>& advance);

/// The same of a job that is one region: in the middle of three layers.
Result<ForwardRun> run_forward(Job job, const std::string& machine, const segment::Segmentation& plan, const ForwardGrid& grid,
                               const std::function<bool(double)>& advance);

}  // namespace lamina::pipeline
