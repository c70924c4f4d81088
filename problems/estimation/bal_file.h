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
// The values are one a line in the published files; any space separates them.
//
// Cost:    linear in the size of the text, which bounds the memory too,
//          whatever counts the text claims.
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

// The text that ParseBal reads back as `data`, bit for bit.
std::string BalText(const BalData& data);

// What ParseBal guarantees and WriteBalFile needs: there is a camera, a point
// and an observation, all indices are valid, and all numbers are finite. If
// not, *error says which condition fails.
bool CheckBal(const BalData& data, std::string* error);

// Decompresses if the path ends in ".bz2".
bool ReadBalFile(const std::string& path, BalData* data, std::string* error);

// A plain text, whatever the path.
bool WriteBalFile(const std::string& path,
                  const BalData& data,
                  std::string* error);

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_BAL_FILE_H_
