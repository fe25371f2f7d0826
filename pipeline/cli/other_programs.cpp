#include "pipeline/cli/other_programs.h"

#include <fmt/format.h>

#include <filesystem>

#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "stages/formats/plot/plot.h"
#include "stages/support/io/file.h"
#include "stages/support/io/other_program.h"

namespace lamina::pipeline {

Status check_plot_name(const std::string& path) {
  const std::filesystem::path name = path;
  if (path.empty()) return {};
  if (name.extension() != ".svg" && name.extension() != ".png")
    return usage("--plot {}: plots are SVG or PNG; end the name with .svg or .png", path);
  return check_folder("--plot", path);
}

Result<std::string> plot_text(const std::string& path, const Plot& plot) {
  auto text = std::filesystem::path(path).extension() == ".svg" ? Result<std::string>(formats::plot_svg(plot))
                                                                : filter("lamina-preview", "--plot", formats::plot_json(plot));
  if (!text) return failure(text.error().fault, "--plot {}: {}", path, text.error().message);
  return text;
}

Status write_plot(const std::string& path, const Plot& plot) {
  const auto text = plot_text(path, plot);
  return text ? write_file(path, *text) : text.error();
}

Result<std::string> scanned(const std::string& what, const Json& request, const std::string& picture) {
  auto text = filter("lamina-scan", what, json_line(request));
  if (!text && text.error().message.starts_with("lamina-scan: ")) {
    return usage("photographs are read by the program lamina-scan, which is missing ({}); install the Debian package lamina-scan, or "
                 "libopencv-core-dev and libopencv-imgproc-dev before lamina is built",
                 text.error().message);
  }
  if (!text) return text;
  const std::size_t end = text->find('\n') + 1;
  if (!picture.empty()) {
    if (Status status = write_file(picture, std::string_view(*text).substr(end)); !status) return status.error();
  }
  return text->substr(0, end);
}

}  // namespace lamina::pipeline
