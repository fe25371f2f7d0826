#include "pipeline/check/replay_job.h"

#include <filesystem>
#include <fstream>
#include <iterator>

#include "pipeline/machine/printer_profile.h"
#include "pipeline/output/print_program.h"
#include "stages/data/hash.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

std::string whole_file(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

Result<replay::VirtualMachine> machine_of_job(const std::string& directory, const ManifestHead& head) {
  const std::string name = "program/machine.toml";
  const fs::path path = fs::path(directory) / name;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return Error{Fault::kVerification, name + ": is missing"};
  const std::string text = whole_file(path);
  if (hash_bytes(std::as_bytes(std::span(text))) != head.machine_profile) {
    return Error{Fault::kVerification, name + ": its content is not what was written"};
  }
  const Result<Machine> machine = read_machine(text, name);
  if (!machine) return machine.error();
  return replay::VirtualMachine::build(*machine, head.grid.columns(), head.grid.rows());
}

std::string program_of_layer(const std::string& directory, const ManifestHead& head, std::uint32_t layer) {
  return whole_file(fs::path(directory) / program_file_name(layer, head.program_extension));
}

}  // namespace lamina::pipeline
