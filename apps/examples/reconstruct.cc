// A COLMAP model from a database with verified pairs (of build_view_graph, or of COLMAP) in one
// call. usage: reconstruct DATABASE MODEL_FOLDER
#include "cairn/mapper/reconstruct.h"

#include <iostream>

#include "cairn/io/colmap_model.h"

int main(int argc, char** argv) try {
  if (argc != 3) throw std::runtime_error("usage: reconstruct DATABASE MODEL_FOLDER");
  const cairn::Database database(argv[1], cairn::Database::Mode::kSnapshot);
  // "": no photographs, so points without colors.
  const cairn::ReconstructResult result = cairn::Reconstruct(database, "");
  if (!result.report.Succeeded()) {
    std::cerr << result.report.failure << "\n";  // which stage failed, and what can be tried
    return 1;
  }
  const cairn::Reconstruction& model = result.models[0];  // the largest
  std::cout << model.images.size() << " of " << result.images.size() << " images, "
            << model.points3D.size() << " points, mean reprojection error "
            << model.MeanReprojectionErrorPx() << " px\n";
  cairn::WriteColmapModel(model, argv[2]);
} catch (
    const std::exception& error) {  // IoError: the database or the folder; ConfigError: options
  std::cerr << error.what() << "\n";
  return 2;
}
