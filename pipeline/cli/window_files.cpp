#include "pipeline/cli/window_files.h"

#include <fmt/format.h>

#include <filesystem>

#include "pipeline/cli/outputs.h"
#include "pipeline/cli/plot_file.h"
#include "stages/formats/voxels/image.h"
#include "stages/formats/voxels/surface_stl.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;
using formats::voxels::VoxelPhase;

struct Choice {
  const char *flag, *content;
  VoxelPhase side;
};
constexpr Choice kChoices[] = {{"--solid", "solid", VoxelPhase::kSolid}, {"--void", "void", VoxelPhase::kVoid}};

bool is_stl(const std::string& path) { return lower_case(fs::path(path).extension().string()) == ".stl"; }

}  // namespace

std::vector<pipeline::OptionSpec> window_file_options() {
  return {{"--solid", "FILE", "what is solid in the window, as voxels .nrrd, .mha, .vti, or as a closed surface .stl", "",
           "Result"},
          {"--void", "FILE", "the same of its void", "", "Result"},
          {"--no-flow", "", "tell pores and write files, but compute no flow", "", "Result"}};
}

Status check_window_files(const pipeline::Arguments& arguments) {
  if (Status status = check_plot_name(arguments.text("--plot")); !status) return status;
  for (const Choice& choice : kChoices) {
    if (!arguments.has(choice.flag)) continue;
    const std::string path = arguments.text(choice.flag), reported = one_line(path);
    if (!is_stl(path) && !formats::voxels::image_kind(path))
      return Error{Fault::kUsage, fmt::format("{} {}: end the name with .nrrd, .mha, .vti or .stl", choice.flag, reported)};
    if (Status status = check_folder(choice.flag, path); !status) return status;
  }
  return {};
}

Result<std::vector<WindowFile>> write_window_files(const pipeline::Arguments& arguments, const VoxelView& window,
                                                   const std::function<Result<Plot>()>& draw) {
  std::vector<WindowFile> written;
  std::vector<File> files;
  const auto begin = [&](const char* flag, const char* content) -> Result<File*> {
    written.push_back({arguments.text(flag), content, 0, 0});
    auto file = File::open(written.back().path);
    if (!file) return file.error();
    files.push_back(std::move(*file));
    return &files.back();
  };
  for (const Choice& choice : kChoices) {
    if (!arguments.has(choice.flag)) continue;
    const auto file = begin(choice.flag, choice.content);
    if (!file) return file.error();
    WindowFile& one = written.back();
    if (is_stl(one.path)) {
      const auto counts = formats::voxels::write_surface(**file, window, choice.side, version());
      if (!counts)
        return Error{counts.error().fault, fmt::format("{} {}: {}", choice.flag, one_line(one.path), counts.error().message)};
      one.facets = counts->facets;
    } else if (Status status =
                   formats::voxels::write_image(**file, window, choice.side, *formats::voxels::image_kind(one.path), version());
               !status) {
      return status.error();
    }
  }
  if (arguments.has("--plot")) {
    const auto file = begin("--plot", "sections");
    if (!file) return file.error();
    const auto plot = draw();
    const auto text = plot ? plot_text(written.back().path, *plot) : plot.error();
    if (!text) return text.error();
    if (Status status = (*file)->append(*text); !status) return status.error();
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto whole = files[i].finish();
    if (!whole) return whole.error();
    written[i].bytes = whole->bytes;
  }
  return written;
}

std::string as_text(const std::vector<WindowFile>& files) {
  std::string text;
  for (const WindowFile& file : files) {
    text += fmt::format("file      {}: the {}, {}{}\n", one_line(file.path), file.content, readable_bytes(file.bytes),
                        file.facets > 0 ? fmt::format(", {} facets", readable_count(file.facets)) : "");
  }
  return text;
}

Json as_json(const std::vector<WindowFile>& files) {
  Json json = Json::array();
  for (const WindowFile& file : files) {
    json.push_back({{"path", file.path}, {"content", file.content}, {"bytes", file.bytes}});
    if (file.facets > 0) json.back()["facets"] = file.facets;
  }
  return json;
}

PoreReport pores_alone(const VoxelView& window) {
  PoreReport report;
  report.voxels = window.voxels();
  report.empty = window.voxels() - set_voxels(window);
  report.porosity = pores::porosity(window);
  report.surface_per_mm = pores::specific_surface(window).crofton;
  return report;
}

}  // namespace lamina::pipeline
