// Reads the bundle adjustment problems of "Bundle Adjustment in the Large", as
// text or compressed by bzip2, and writes them as text.
//
//   cameras points observations
//   camera point x y            one line an observation
//   ...
//   value                       9 values a camera: rotation (angle axis),
//   ...                         translation, focal length, k1, k2
//   value                       3 values a point
//
// Published files have one value per line; any white space separates values, and
// lines after the first may be blank.
//
// Cost:    linear in the size of the text, which also bounds the memory, for
//          any counts in the text.
// Fails:   returns false with "FILE:LINE: what is wrong; expected ..." if the
//          text is empty, cut off, continues after its end, names a camera or a
//          point that it does not have, or has a number that is not finite;
//          for .bz2 also if it cannot be decompressed, or its text is longer
//          than 2 GiB, or than 64 MiB and a hundred times its compressed size.
//          *data is then unchanged.
//
// [1] Agarwal, Snavely, Seitz, Szeliski. Bundle Adjustment in the Large. ECCV
//     2010. https://grail.cs.washington.edu/projects/bal
#ifndef PROBLEMS_ESTIMATION_BAL_FILE_H_
#define PROBLEMS_ESTIMATION_BAL_FILE_H_

#include <string>
#include <vector>

#include "Eigen/Core"

namespace invgrad {

struct BalData {
  struct Observation {
    int camera;
    int point;
    double x;  // pixels from the image's centre
    double y;
  };

  std::vector<Observation> observations;
  Eigen::Matrix<double, 9, Eigen::Dynamic> cameras;  // one a column
  Eigen::Matrix<double, 3, Eigen::Dynamic> points;   // one a column
};

// `file`: the name of the text in messages.
bool ParseBal(const std::string& text,
              const std::string& file,
              BalData* data,
              std::string* error);

// Formats `data` as text that ParseBal reads back bit for bit.
std::string BalText(const BalData& data);

// Decompresses if the path ends in ".bz2".
bool ReadBalFile(const std::string& path, BalData* data, std::string* error);

// Writes plain text if ParseBal can read it back.
bool WriteBalFile(const std::string& path,
                  const BalData& data,
                  std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_BAL_FILE_H_
