#include "pipeline/command_line.h"

int main(int argc, char** argv) { return lamina::pipeline::run_program(argc, argv); }
