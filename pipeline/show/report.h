// pipeline/show/report.h: a finished job as one page for people.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct ReportOptions {
  std::uint64_t size_limit = 19'000'000;  // bytes of the page; layers are left out evenly to stay below it
  std::vector<std::string> parts;         // folders, or files, where the parts may be; looked at first
};

struct Report {
  std::string page;                    // HTML that needs no other file and no network
  std::uint32_t layers = 0, held = 0;  // of the job; that can be looked at
  std::uint32_t stride = 1;            // every stride-th is held
  std::string without_parts;           // why the parts are shown as their layers build them up; empty if they are themselves
};

/// Reads a finished directory of lamina jet, or a G-code file of lamina extrude with its manifest beside it. Every file is read
/// and has to be what the manifest says; print programs are carried out by the virtual machine, which gives the time of each
/// layer. Toolpaths are shown as what their beads cover, in their true widths.
///
/// The parts from three sides are ray-cast from their files, which are looked for in options.parts, the working directory,
/// that of the manifest and the one above it. Where they are not found or have changed, the layers are shown from three sides
/// instead; parts that were asked for have to be there.
/// errors  kVerification: no manifest, a job that is not finished, no images, a file that is missing or has changed, a program
///         that prints something else; kInput: options.parts do not hold the parts
/// cost    decodes every layer, on all processors; memory is the page and the layers being read
Result<Report> make_report(const std::string& path, const ReportOptions& options);

}  // namespace lamina::pipeline
