// pipeline/report.h: a finished job as one page for people.
#pragma once

#include <cstdint>
#include <string>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct ReportOptions {
  std::uint64_t size_limit = 19'000'000;  // bytes of the page; layers are left out evenly to stay below it
};

struct Report {
  std::string page;                   // HTML that needs no other file and no network
  std::uint32_t layers = 0, held = 0;  // of the job; that can be looked at
  std::uint32_t stride = 1;           // every stride-th is held
};

/// Reads a finished directory of lamina jet. Every layer's file is read once and has to be what the manifest says.
/// errors  kVerification: no manifest, a job that is not finished, no images, a file that is missing or has changed
/// cost    decodes every layer, on all processors; memory is the page and the layers being read
Result<Report> make_report(const std::string& directory, const ReportOptions& options);

}  // namespace lamina::pipeline
