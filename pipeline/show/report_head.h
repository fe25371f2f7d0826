// pipeline/show/report_head.h: the data about a job in a report page, for the page's script.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/buffer.h"
#include "stages/data/grid.h"
#include "stages/data/status.h"
#include "stages/geometry/coverage.h"  // PixelWindow
#include "stages/support/hash/hash.h"
#include "stages/view/report/run_code.h"

namespace lamina::pipeline {

/// A view in the page: its entry in the head, and its pixels.
struct ShownView {
  std::string name;
  std::uint32_t width = 0, height = 0, maximum = 0;  // most: of a depth; 0 for light and cover
  double width_mm = 0, height_mm = 0;
  Buffer<std::byte> deflated;
};

/// Where something was found in the layers.
struct ReportLocation {
  std::string code;                     // of its warning
  double x_mm = 0, y_mm = 0, z_mm = 0;  // the middle, on the bed; the bottom
  double width_mm = 0, depth_mm = 0;    // of the box around it; 0: a spot
  std::uint32_t layer = 0, last_layer = 0;
  std::string unit;  // of `amount`; empty: none is known
  double amount = 0;
  double column_mm = 0, row_mm = 0;  // the middle from the left and the top of the image
};

/// The result of one pass over all layers.
struct ReportLayers {
  PixelWindow window;
  std::vector<std::uint64_t> set;    // pixels of each
  std::vector<double> seconds;       // of each, with a machine
  std::vector<double> overhang_mm2;  // of each, of toolpaths whose parts are there; else empty
  std::vector<Warning> warnings;
  std::vector<ReportLocation> positions;
  std::string sweeps;                           // what drops of a pixel take of a head that fires several
  std::string deposited;                        // lines on what toolpaths leave open
  std::string deposited_svg;                    // a picture of it; "" for none
  std::vector<std::vector<std::string>> quote;  // rows of a table of costs; empty for none
};

/// The manifest's own file.
struct ReportManifest {
  std::string name;
  FileDigest digest;
};

/// The title of the job.
std::string page_title(const ManifestHead& head);

/// One JSON object on a line: the job, its parts and views, and a list of numbers for each column of its layers.
/// grid  of the layers' pixels
/// cost  O(layers)
std::string head_json(const Manifest& manifest, const ReportManifest& file, const PixelGrid& grid, const ReportLayers& detected,
                      view::report::HeldLayers& held, const std::vector<ShownView>& views);

/// Adds the warnings and places of the job's inspection.json to the findings; nothing without a file of this job.
/// directory  of the manifest. mirrored  whether columns and rows of the images are, on which places are then shown
void add_inspection(const std::string& directory, const ManifestHead& head, bool mirrored_x, bool mirrored_y,
                    ReportLayers& detected);

}  // namespace lamina::pipeline
