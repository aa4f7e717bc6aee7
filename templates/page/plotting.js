// `makePlotting`: connects the plots with the run that is replayed or with the live motion.

const makePlotting = () => ({ source() {}, append() {}, cursor() {}, restart() {}, repaint() {} });
