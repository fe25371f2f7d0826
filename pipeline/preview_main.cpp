// pipeline/preview_main.cpp: the program lamina-preview, started by `lamina preview`.
#include <fmt/format.h>

#include <type_traits>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/show/sheet.h"
#include "stages/formats/plot/plot.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/text/number_text.h"
#include "stages/view/picture/plot.h"

namespace lamina::pipeline {
namespace {

/// lamina-preview --plot: converts a plot on standard input to a PNG on standard output, or reports the error.
Outcome draw_plot(Context& context) {
  const auto end = [&](std::string_view text, int code) {
    const Status status = context.print(text);
    return status ? code : static_cast<int>(status.error().fault);
  };
  const auto text = read_file("-", {.fault = Fault::kUsage, .max_bytes = 1u << 30, .streams = true});
  const auto plot = text ? formats::read_plot(*text) : text.error();
  const auto picture = plot ? view::picture::plot_png(*plot) : plot.error();
  if (!picture) return end(picture.error().message, static_cast<int>(picture.error().fault));
  return end({reinterpret_cast<const char*>(picture->data()), picture->size()}, 0);
}

/// Sets `value` to the number after a flag, if present: a length in mm, or a whole number.
template <class Value, class Number = std::conditional_t<std::is_same_v<Value, double>, double, std::uint32_t>>
Status read_flag(const Arguments& arguments, std::string_view flag, double minimum, double maximum, Value& value) {
  if (!arguments.has(flag)) return {};
  double number = 0;
  std::string fault = read_number(arguments.text(flag), minimum, maximum, "", number);
  if (fault.empty() && static_cast<Number>(number) != number) fault = "give a whole number";
  if (!fault.empty()) return Error{Fault::kUsage, fmt::format("{} {}: {}", flag, arguments.text(flag), fault)};
  value = static_cast<Number>(number);
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
  for (const Status& status :
       {read_flag(arguments, "--width", 200, 20'000, request.width),
        read_flag(arguments, "--layer", 0, UINT32_MAX, request.layers.layer),
        read_flag(arguments, "--every", 1, UINT32_MAX, request.layers.every),
        read_flag(arguments, "--count", 1, view::kMaxCells, request.layers.count),
        read_flag(arguments, "--step", 0, UINT32_MAX, request.step),
        read_flag(arguments, "--filament", 0.5, 10, request.gcode.filament_mm),
        read_flag(arguments, "--layer-height", 0.01, 100, request.gcode.layer_height_mm),
        arguments.text("--swath") == "middle" ? Status()
                                              : read_flag(arguments, "--swath", 0, UINT32_MAX, request.swath_number),
        arguments.read("--memory", read_bytes, request.memory_bytes)}) {
    if (!status) return status.error();
  }
  if (request.step && !request.swath) return at_option("--step", "needs a swath; add --swath").error();
  if (request.swath && (request.layers.every || request.layers.count)) {
    return at_option("--swath", "is drawn in one layer; choose it by --layer, and leave out --count and --every").error();
  }
  return request;
}

Outcome draw(const Arguments& arguments, Context& context) {
  const auto request = read_request(arguments);
  if (!request) return request.error();
  const auto preview = draw_preview(*request);
  if (!preview) return preview.error();
  if (Status status = write_file(request->output, preview->bytes); !status) return status;
  for (const std::string& warning : preview->warnings) {
    if (!arguments.has("--quiet")) context.say(warning);
  }
  Answer answer(arguments, context);
  answer.say(preview->said);
  return answer.status();
}

Outcome run_preview(const std::vector<std::string>& words, Console& console) {
  if (words.size() == 1 && words.front() == "--plot") return draw_plot(console);
  Command command = preview_command;
  command.run = draw;
  command.reads_itself = false;
  return run_command(command, words, console);
}

}  // namespace
}  // namespace lamina::pipeline

int main(int argc, char** argv) { return lamina::pipeline::run_program(argc, argv, lamina::pipeline::run_preview); }
