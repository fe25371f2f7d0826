// pipeline/show/report.h: a finished job as one HTML page.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct ReportOptions {
  std::uint64_t size_limit = 19'000'000;  // bytes of the page; layers are omitted evenly to stay below it
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;  // of layers in flight
  std::vector<std::string> parts;         // folders or files to search first for the parts
  std::string deposited;                  // lines on what toolpaths leave open, a section of the page; "" for none
  std::string deposited_svg;              // a picture of it; "" for none
};

struct Report {
  std::string page;                    // self-contained HTML
  std::uint32_t layers = 0, held = 0;  // of the job; included in the page
  std::uint32_t stride = 1;            // every stride-th layer is included
  std::string without_parts;           // why views use layers instead of part files; empty if the files are used
};

/// Reads a finished directory of lamina jet, or a G-code file of lamina extrude with its manifest next to it. Every file is
/// read and must match the manifest. The virtual machine replays print programs and computes the time of each layer.
/// Toolpaths appear as the area of their beads at true width.
///
/// Three views of the parts are ray-cast from their files, searched in options.parts, the working directory, the manifest's
/// directory and its parent. If files are missing or changed, the views use the layers instead; with options.parts this is
/// an error.
/// errors  kVerification: no manifest, an unfinished job, no images, a missing or changed file, a program that prints a
///         different image; kInput: options.parts lacks the parts
/// cost    decodes every layer, on all processors; memory of the page and the layers being read
Result<Report> make_report(const std::string& path, const ReportOptions& options);

}  // namespace lamina::pipeline
