#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <filesystem>

#include "pipeline/cli/command.h"

namespace lamina::pipeline {
namespace {

CommandSpec preview_spec() {
  CommandSpec spec;
  spec.summary =
      "Draws layers of a job as one picture (PNG), each pixel as dark as the share of its area that is set; or one layer of\n"
      "a sliced job with its filling, or of a G-code file, bead widths true (PNG or SVG), or several with --count or --every\n"
      "(PNG).";
  spec.operand = "DIR|GCODE";
  spec.operand_meaning =
      "directory that lamina jet or lamina slice wrote, or a G-code file of lamina extrude or another slicer";
  spec.options = {
      {"-o,--output", "PNG", "the picture", "", ""},
      {"--count", "N", "so many layers, spread over the height", "12", ""},
      {"--every", "N", "every N-th layer, from the first", "", ""},
      {"--layer", "K", "only layer K, counted from 0 at the bottom", "", ""},
      {"--swath", "N",
       "layer --layer of a job with a machine while swath N of it is jetted, with the head; middle for the one in the middle",
       "", ""},
      {"--step", "N", "of the swath, else the middle one", "", ""},
      {"--width", "PIXELS", "width of the picture, 200 to 20000", "2400", ""},
      {"--whole-bed", "", "show all of the bed, not only where the layers have something", "", ""},
      {"--drawing", "FILE", "draw what lamina heights left for it instead, and remove FILE", "", ""},
      {"--overwrite", "", "replace a file that lamina did not write", "", ""},
      {"--quiet", "", "say nothing but errors", "", ""}};
  spec.closing =
      "Examples:\n"
      "  lamina preview out -o sheet.png\n"
      "  lamina preview out -o layer.png --layer 120 --whole-bed\n"
      "  lamina preview sliced -o layer.svg --layer 12\n"
      "  lamina preview part.gcode -o layer.png --layer 3";
  return spec;
}

Outcome run_preview(const Arguments& arguments, Context&) { return hand_over_to_preview(arguments.given); }

}  // namespace

const Command preview_command = {"preview", "pictures of a job's layers for people", preview_spec, run_preview, true};

// Pictures need libraries that no job should have to load: they are made by a program of its own.
Error hand_over_to_preview(const std::vector<std::string>& arguments) {
  constexpr const char* kProgram = "lamina-preview";
  std::vector<char*> texts;
  std::string name = kProgram;
  texts.push_back(name.data());
  std::vector<std::string> copies = arguments;
  for (std::string& argument : copies) texts.push_back(argument.data());
  texts.push_back(nullptr);

  std::error_code error;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", error);
  std::signal(SIGPIPE, SIG_DFL);
  std::signal(SIGXFSZ, SIG_DFL);
  if (!error) ::execv((own.parent_path() / kProgram).c_str(), texts.data());
  ::execvp(kProgram, texts.data());
  return {Fault::kInternal,
          fmt::format("{}: {}; it belongs beside lamina or into PATH, install it there", kProgram, std::strerror(errno))};
}

}  // namespace lamina::pipeline
