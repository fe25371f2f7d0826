// pipeline/preview_main.cpp: the program lamina-preview, which `lamina preview` hands over to.
#include <fmt/format.h>

#include <charconv>
#include <csignal>
#include <iostream>
#include <iterator>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/show/plot_json.h"
#include "pipeline/show/sheet.h"
#include "stages/write/file.h"
#include "stages/write/picture/plot.h"

namespace lamina::pipeline {
namespace {

/// lamina-preview --plot: a plot on standard input becomes a PNG on standard output, or the reason why not.
int draw_plot() {
  const std::string json{std::istreambuf_iterator<char>(std::cin), {}};
  const auto end = [](const Error& error) {
    const Status status = print(error.message);
    return static_cast<int>(status ? error.fault : status.error().fault);
  };
  const auto plot = read_plot(json);
  if (!plot) return end(plot.error());
  const auto picture = write::picture::plot_png(*plot);
  if (!picture) return end(picture.error());
  const Status status = print({reinterpret_cast<const char*>(picture->data()), picture->size()});
  return status ? 0 : static_cast<int>(status.error().fault);
}

/// Sets `value` to the number behind a flag, if it is there.
Status read_whole(const Arguments& arguments, std::string_view flag, std::uint32_t least, std::uint32_t most,
                  std::optional<std::uint32_t>& value) {
  if (!arguments.has(flag)) return {};
  const std::string text = arguments.text(flag);
  std::uint32_t number = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (code != std::errc() || end != text.data() + text.size() || number < least || number > most) {
    return Error{Fault::kUsage, fmt::format("{} {}: give a whole number from {} to {}", flag, text, least, most)};
  }
  value = number;
  return {};
}

Result<PreviewRequest> read_request(const Arguments& arguments) {
  if (arguments.operands.size() != 1) {
    return Error{Fault::kUsage, "name one directory that lamina jet or lamina slice wrote, or one G-code file"};
  }
  PreviewRequest request;
  request.source = arguments.operands.front();
  request.output = arguments.text("-o,--output");
  if (request.output.empty()) return Error{Fault::kUsage, "-o PNG is missing; name the picture"};
  request.whole_bed = arguments.has("--whole-bed");
  request.swath = arguments.has("--swath");
  const auto whole = [&](std::string_view flag, std::uint32_t least, std::uint32_t most, std::optional<std::uint32_t>& value) {
    return read_whole(arguments, flag, least, most, value);
  };
  for (const Status& status :
       {whole("--width", 200, 20'000, request.width), whole("--layer", 0, UINT32_MAX, request.layers.layer),
        whole("--every", 1, UINT32_MAX, request.layers.every), whole("--count", 1, kMostCells, request.layers.count),
        whole("--step", 0, UINT32_MAX, request.step),
        arguments.text("--swath") == "middle" ? Status() : whole("--swath", 0, UINT32_MAX, request.swath_number)}) {
    if (!status) return status.error();
  }
  return request;
}

int run_preview(const std::vector<std::string>& texts) {
  if (texts.size() == 1 && texts.front() == "--plot") return draw_plot();
  const Result<Arguments> arguments = read_arguments(spec_of(preview_command), texts);
  if (!arguments) return fail(arguments.error());
  if (arguments->help) {
    const Status status = print(*arguments->help);
    return status ? 0 : fail(status.error());
  }
  if (Status status = check_outputs("preview", *arguments); !status) return fail(status.error());
  const auto request = read_request(*arguments);
  if (!request) return fail(request.error());
  const auto preview = draw_preview(*request);
  if (!preview) return fail(preview.error());
  if (const Status status = write::write_file(request->output, preview->bytes); !status) return fail(status.error());
  if (arguments->has("--quiet")) return 0;
  for (const std::string& line : preview->said) say(line);
  return 0;
}

}  // namespace
}  // namespace lamina::pipeline

int main(int argc, char** argv) {
  // A full disk and a closed pipe are reported by the calls that meet them.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  try {
    return lamina::pipeline::run_preview({argv + 1, argv + argc});
  } catch (const std::exception& exception) {
    return lamina::pipeline::fail({lamina::Fault::kInternal, exception.what()});
  }
}
