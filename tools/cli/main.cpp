// SPDX-License-Identifier: BSD-3-Clause
// The `dynslam` command line.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <exception>
#include <iostream>
#include <new>
#include <opencv2/core.hpp>
#include <string>

#include "config_command.hpp"
#include "config_file.hpp"
#include "convert_command.hpp"
#include "dynslam/runtime/error.hpp"
#include "dynslam/runtime/nets/inference_engine.hpp"
#include "evaluate_command.hpp"
#include "exit_codes.hpp"
#include "help_commands.hpp"
#include "info_command.hpp"
#include "map_command.hpp"
#include "masks_command.hpp"
#include "plain_output.hpp"
#include "readout_command.hpp"
#include "report_command.hpp"
#include "run_command.hpp"
#include "suggestion.hpp"
#include "sweep_command.hpp"
#include "synth_command.hpp"

namespace {

int not_enough_memory() {
  std::cerr << "dynslam: error: there is not enough memory\n";
  return dynslam::app::kInputFailure;
}

int run(int argc, char** argv) {
  using namespace dynslam::app;
  CLI::App app("RGB-D semantic visual SLAM that keeps working when people and things move", "dynslam");
  app.set_version_flag("--version", "dynslam " DYNSLAM_VERSION);
  app.require_subcommand(1);
  const RunCommand run_command(app);
  const AblateCommand ablate(app);
  const EvaluateCommand evaluate(app);
  const InfoCommand info(app);
  const ReadoutCommand readout(app);
  const ConvertCommand convert(app);
  const SynthCommand synth(app);
  const MapCommand map(app);
  const MasksCommand masks(app);
  const SweepCommand sweep(app);
  const ReportCommand report(app);
  const ConfigCommand show(app, run_command);
  const HelpCommands help(app);
  const auto config = add_config_option(app, {{"run", run_command.fields()}, {"ablate", ablate.fields()}});
  try {
    app.parse(arguments(argc, argv));
    if (run_command.chosen()) return run_command.run();
    if (show.chosen()) return show.run();
    if (help.chosen()) return help.run();
    if (ablate.chosen()) return ablate.run();
    if (evaluate.chosen()) return evaluate.run();
    if (info.chosen()) return info.run();
    if (readout.chosen()) return readout.run();
    if (convert.chosen()) return convert.run();
    if (synth.chosen()) return synth.run();
    if (sweep.chosen()) return sweep.run();
    if (masks.chosen()) return masks.run();
    if (report.chosen()) return report.run();
    return map.run();
  } catch (const CLI::FileError&) {
    std::cerr << "dynslam: error: " << app.get_config_ptr()->as<std::string>() << ": cannot be opened\n";
    return kInputFailure;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    if (const std::string place = config->origin(error.what()); !place.empty()) {
      std::cerr << "dynslam: error: " << place << error.what() << '\n';
      return kInputFailure;
    }
    const bool no_command = app.get_subcommands().empty() && argc > 1 && argv[1][0] != '-';
    std::string reason = no_command ? fmt::format("unknown command '{}'", argv[1]) : error.what();
    if (no_command) {
      reason += suggestion(app, {argv[1]});
    } else if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError)) {
      reason += suggestion(app, {argv + 1, argv + argc});
    }
    std::cerr << "dynslam: error: " << reason << " (see dynslam --help)\n";
    return kUsageFailure;
  } catch (const dynslam::runtime::UsageError& error) {
    std::cerr << "dynslam: error: " << error.what() << '\n';
    return kUsageFailure;
  } catch (const dynslam::runtime::InferenceStopped&) {
    std::cerr << "dynslam: interrupted\n";
    return kInterrupted;
  } catch (const std::bad_alloc&) {
    return not_enough_memory();
  } catch (const cv::Exception& error) {
    if (error.code == cv::Error::StsNoMem) return not_enough_memory();
    std::cerr << "dynslam: error: " << error.what() << '\n';
    return kInputFailure;
  } catch (const std::exception& error) {
    std::cerr << "dynslam: error: " << error.what() << '\n';
    return kInputFailure;
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);  // a reader that went away is an error of writing like a full disk
  const dynslam::app::PlainOutput plain_out(std::cout), plain_error(std::cerr);
  const int code = run(argc, argv);
  std::cout.flush();
  if (std::cout) return code;
  std::cerr << "dynslam: error: the standard output could not be written\n";
  return code != 0 ? code : dynslam::app::kInputFailure;
}
