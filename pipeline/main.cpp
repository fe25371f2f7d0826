#include "pipeline/cli/command.h"

int main(int argc, char** argv) { return lamina::pipeline::run_program(argc, argv, lamina::pipeline::run_lamina); }
